"""The fold guard's rounds over all children, with the numbers of ``fold_guard.FoldGuard``."""

from __future__ import annotations

import math
from itertools import count

import numpy as np
from jaxtyping import Bool, Float

from pns_common.base.blocks import Blocks
from pns_common.formula.fold_guard import ROUNDS, FoldGuard
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.guard import HELD, find_folds
from pns_common.fused.kernels.together import TOGETHER
from pns_common.fused.levels.mesh_edges import MeshEdges

# For the kernel: no vertex is shared, all faces are looked at, and s is 1 everywhere.
NONE_SHARED, EVERYWHERE, UNSCALED = np.zeros(0, dtype=bool), np.zeros(0, dtype=bool), np.zeros(0)


def guard_scale(
    guard: FoldGuard,
    mesh: MeshEdges,
    loop: Float[np.ndarray, "W 3"],
    displacement: Float[np.ndarray, "W 3"],
    blocks: Blocks,
    shared: Bool[np.ndarray, " W"] | None = None,
    moved: Bool[np.ndarray, " M"] = EVERYWHERE,
) -> Float[np.ndarray, " W"] | None:
    """Return s for each new vertex of the split of ``mesh``; ``shared`` as the guard has it.

    None where it is 1 everywhere. ``moved`` are the vertices whose displacement is not 0: children
    without one are Loop's.
    """
    scale, changed = UNSCALED, moved
    is_shared = NONE_SHARED if shared is None else shared
    for rounds in count():
        around = loop, displacement, scale, is_shared, math.cos(guard.angle)
        changed = _touched(around, mesh, changed, blocks)
        rows = np.flatnonzero(changed)
        if len(rows) == 0:
            break
        if not len(scale):
            scale = np.ones(len(loop))
        scale[rows] = scale[rows] / 2 if rounds < ROUNDS else 0.0
    return scale if len(scale) else None


def _touched(
    around: tuple[np.ndarray | float, ...],
    mesh: MeshEdges,
    changed: Bool[np.ndarray, " C"],
    blocks: Blocks,
) -> Bool[np.ndarray, " W"]:
    """Return folded children's corners, of children whose corners ``changed``; empty: of all."""
    touched = np.zeros(mesh.vertex_count + len(mesh.edges), dtype=bool)
    find = find_folds.over(*around, mesh.faces, mesh.face_edges, mesh.vertex_count, changed, ROWS)
    blocks.run(len(mesh.faces), lambda rows: find(rows, np.empty(HELD * TOGETHER), touched))
    return touched
