"""Loop's masks alone, over any columns: what follows a mesh's vertices without being a position.

Skin weights and morph deltas go through the stencils that move the vertices; the learned correction
is no part of it, so the result is linear in the columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int, Real

from pns_common.connectivity.creases import NO_CREASES, Creases, crease_children, with_creases
from pns_common.connectivity.topology import Topology, build_topology, split
from pns_common.errors import ParameterError
from pns_common.masks.limit import refined_limit_positions
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.mesh import check_faces


def level_topologies(
    faces: Int[np.ndarray, "F 3"],
    vertex_count: int,
    levels: int,
    creases: Creases = NO_CREASES,
) -> list[Topology]:
    """Return the topologies that ``levels`` steps of ``refine`` go through, control mesh first.

    The creases are those that are named: nothing is known here of the mesh's shape.

    Raises:
        MeshError: wrong shape or type of the faces, or an index out of range.
        ParameterError: a crease is no edge.
    """
    check_faces(faces, vertex_count)
    topologies: list[Topology] = []
    named = creases.named
    for depth in range(levels):
        topology = build_topology(faces, vertex_count)
        if named is not None and creases.sharp_at(depth):
            topology = with_creases(topology, named)
            named = crease_children(topology)
        topologies.append(topology)
        faces, vertex_count = split(topology), vertex_count + len(topology.edges)
    return topologies


def refine_linear(
    columns: Real[np.ndarray, "V K"], topologies: Sequence[Topology]
) -> Float[np.ndarray, "W K"]:
    """Refine columns by Loop's masks, level by level; whole numbers as float64.

    Raises:
        ParameterError: there is not one row for each vertex.
    """
    if topologies and (columns.ndim != 2 or len(columns) != topologies[0].vertex_count):
        expected = f"({topologies[0].vertex_count}, K), a row for each vertex"
        raise ParameterError("columns.shape", columns.shape, expected=expected)
    if columns.dtype.kind != "f":
        columns = columns.astype(np.float64)
    for topology in topologies:
        vertices = loop_vertex_vertices(columns, topology)
        columns = np.concatenate([vertices, loop_edge_vertices(columns, topology)])
    return columns


@runtime_checkable
class ColumnRefinement(Protocol):
    """What refines columns, however it does that."""

    @property
    def count(self) -> int:
        """How many refined vertices there are."""
        ...

    def __call__(self, columns: Float[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Refine columns."""
        ...


@dataclass(frozen=True, eq=False)
class LinearRefinement:
    """What happens to columns when a mesh is refined, on its way to the limit surface or not.

    Attributes:
        topologies: those of the steps, control mesh first.
        limit: whether the last level's vertices are put on the limit surface.
    """

    topologies: Sequence[Topology]
    limit: bool

    @property
    def count(self) -> int:
        """How many refined vertices there are."""
        last = self.topologies[-1]
        return last.vertex_count + len(last.edges)

    def __call__(self, columns: Float[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Refine columns."""
        refined = refine_linear(columns, self.topologies)
        return refined_limit_positions(refined, self.topologies[-1]) if self.limit else refined
