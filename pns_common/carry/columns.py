"""A base scheme's masks alone, on any columns: what follows vertices without being a position.

Skin weights and morph deltas go through the masks that move the vertices; the learned correction
is no part of it, so the result is linear in the columns; ``Scheme.matrix`` is that linear map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Real

from pns_common.errors import MeshError, ParameterError
from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.mesh import as_polygons
from pns_common.mesh.topology import Topology, build_topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.limit import limit_positions
from pns_common.schemes.loop import LOOP


def level_topologies(
    faces: Any,
    vertex_count: int,
    levels: int,
    creases: Creases = NO_CREASES,
    base: BaseScheme = LOOP,
    blocks: Blocks | None = None,
) -> list[Topology]:
    """Return the topologies of the meshes that ``levels`` steps refine, control mesh first.

    The creases are those that are named: without positions none is found by its angle. Faces are
    as ``Mesh`` takes them, or none.

    Raises:
        MeshError: wrong shape or type of the faces, an index out of range, or polygons for a scheme
            of triangles.
        ParameterError: a crease is no edge.
    """
    corners, offsets = as_polygons(faces, vertex_count)
    blocks = blocks or Blocks()
    mesh = build_topology((corners, offsets), vertex_count, blocks)
    if not (mesh.triangles or base.polygons):
        raise MeshError("polygons, expected triangles", element="faces")
    topologies = [creases.applied_by_name(mesh)]
    for depth in range(1, levels):
        topologies.append(base.split(topologies[-1], blocks, inherit=creases.sharp_at(depth)))
    return topologies[:levels]


def refine_columns(
    columns: Real[np.ndarray, "V K"],
    topologies: Sequence[Topology],
    base: BaseScheme = LOOP,
    *,
    limit: bool = False,
    blocks: Blocks | None = None,
) -> Float[np.ndarray, "W K"]:
    """Refine columns by a base scheme's masks, level by level.

    Args:
        columns: a row for each control vertex.
        topologies: those of the meshes that are refined, control mesh first: of
            ``level_topologies``, or ``Refinement.topologies``.
        base: the scheme.
        limit: apply the limit mask at the end.
        blocks: how the work is shared.

    Raises:
        ParameterError: there is not one row for each vertex.
    """
    return ColumnRefinement(topologies, base, limit, blocks or Blocks())(columns)


@dataclass(frozen=True, eq=False)
class ColumnRefinement:
    """``refine_columns`` for many calls over one mesh.

    Attributes:
        topologies: those of the meshes that are refined, control mesh first; one at least.
        base: the scheme.
        limit: whether the limit mask is applied at the end.
        blocks: how the work is shared.
        surface: the topology of the refined mesh; None: it is made where it is needed.
    """

    topologies: Sequence[Topology]
    base: BaseScheme = LOOP
    limit: bool = False
    blocks: Blocks = field(default_factory=Blocks)
    surface: Topology | None = None

    @cached_property
    def last(self) -> Topology:
        """The topology of the refined mesh."""
        return self.surface or self.base.split(self.topologies[-1], self.blocks)

    @property
    def count(self) -> int:
        """Number of refined vertices."""
        mesh = self.topologies[-1]
        return mesh.vertex_count + len(mesh.edges) + mesh.face_count * self.base.polygons

    def __call__(self, columns: Real[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Refine columns. Raises ParameterError unless there is one row for each vertex."""
        count = self.topologies[0].vertex_count
        if columns.ndim != 2 or len(columns) != count:
            expected = f"({count}, K), a row for each vertex"
            raise ParameterError("columns.shape", columns.shape, expected=expected)
        values = np.asarray(columns, dtype=np.float64)
        for topology in self.topologies:
            values = self.base.place(values, topology, self.blocks)
        return limit_positions(values, self.last, self.blocks, self.base) if self.limit else values
