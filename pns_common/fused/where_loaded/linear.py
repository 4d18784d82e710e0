"""Loop's masks over any columns, by the kernels that place points: three columns at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks, available_threads
from pns_common.connectivity.creases import Creases
from pns_common.fused import fits, kernel_blocks, kernels_loaded
from pns_common.fused.levels.level import control_edges, next_edges, topology_of
from pns_common.fused.levels.loop_points import loop_points
from pns_common.fused.levels.mesh_edges import MeshEdges
from pns_common.masks.limit import refined_limit_positions
from pns_common.masks.linear import ColumnRefinement, LinearRefinement, level_topologies

# A point's coordinates.
WIDTH = 3


@dataclass(frozen=True, eq=False)
class FusedLinearRefinement:
    """``LinearRefinement``, bit for bit; ``meshes`` are those of the steps."""

    meshes: Sequence[MeshEdges]
    limit: bool
    blocks: Blocks

    @property
    def count(self) -> int:
        """How many refined vertices there are."""
        return self.meshes[-1].vertex_count + len(self.meshes[-1].edges)

    def __call__(self, columns: Float[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Refine columns."""
        width = columns.shape[1]
        if width == WIDTH:
            refined = self._three(columns)
        else:
            refined = np.empty((self.count, width))
            for start in range(0, width, WIDTH):
                given = columns[:, start : start + WIDTH]
                points = np.zeros((len(columns), WIDTH))
                points[:, : given.shape[1]] = given
                refined[:, start : start + WIDTH] = self._three(points)[:, : given.shape[1]]
        if self.limit:
            return refined_limit_positions(refined, topology_of(self.meshes[-1]))
        return refined

    def _three(self, points: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "W 3"]:
        points = np.ascontiguousarray(points)
        for mesh in self.meshes:
            points = loop_points(points, mesh, self.blocks)
        return points


def linear_refinement(
    faces: Int[np.ndarray, "F 3"],
    vertex_count: int,
    levels: int,
    creases: Creases,
    *,
    limit: bool,
) -> ColumnRefinement:
    """Return what refines columns as ``levels`` steps of ``refine`` move points.

    The kernels do it in a fifth of the time; they are not loaded for this.
    """
    if not (kernels_loaded() and fits(vertex_count, len(faces), levels)):
        return LinearRefinement(level_topologies(faces, vertex_count, levels, creases), limit)
    blocks = kernel_blocks(available_threads())
    meshes = [control_edges(faces, vertex_count, creases.named, blocks)]
    for depth in range(1, levels):
        meshes.append(next_edges(meshes[-1], blocks, sharp=creases.sharp_at(depth)))
    return FusedLinearRefinement(meshes, limit, blocks)
