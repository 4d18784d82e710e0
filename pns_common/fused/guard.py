"""The fold guard's rounds over all children, with the numbers of ``fold_guard.FoldGuard``."""

from __future__ import annotations

import math
from itertools import count

import numpy as np
from jaxtyping import Bool, Float

from pns_common.base.blocks import Blocks
from pns_common.formula.fold_guard import ROUNDS, FoldGuard
from pns_common.fused.kernels.guard import find_folds
from pns_common.fused.mesh_edges import MeshEdges

# For the kernel: all faces are looked at, and s is 1 everywhere.
EVERYWHERE, UNSCALED = np.zeros(0, dtype=bool), np.zeros(0)


def guard_scale(
    guard: FoldGuard,
    mesh: MeshEdges,
    loop: Float[np.ndarray, "W 3"],
    displacement: Float[np.ndarray, "W 3"],
    blocks: Blocks,
    first: Bool[np.ndarray, " W"] | None = None,
) -> Float[np.ndarray, " W"] | None:
    """Return s for each new vertex of the split of ``mesh``; ``first`` as the guard has it.

    None where it is 1 everywhere.
    """
    settings = guard, mesh, loop, displacement
    scale, free = UNSCALED, None
    if first is not None:
        # Faces with none of these corners are Loop's while the others' s is 0.
        alone = _settled(*settings, first.astype(float), first, blocks, watched=first)
        scale = np.where(first, alone, 1.0)
        scale, free = (scale if scale.min() < 1 else UNSCALED), ~first
    scale = _settled(*settings, scale, free, blocks)
    return scale if len(scale) else None


def _settled(
    guard: FoldGuard,
    mesh: MeshEdges,
    loop: Float[np.ndarray, "W 3"],
    displacement: Float[np.ndarray, "W 3"],
    scale: Float[np.ndarray, " S"],
    free: Bool[np.ndarray, " W"] | None,
    blocks: Blocks,
    watched: Bool[np.ndarray, " C"] = EVERYWHERE,
) -> Float[np.ndarray, " N"]:
    """Lower s of free vertices until no child is folded; of those with a ``watched`` corner."""
    changed = watched
    for rounds in count():
        changed = _touched(guard, mesh, loop, displacement, scale, changed, blocks)
        if free is not None:
            changed &= free
        if not changed.any():
            break
        if not len(scale):
            scale = np.ones(len(loop))
        scale[changed] = scale[changed] / 2 if rounds < ROUNDS else 0.0
    return scale


def _touched(
    guard: FoldGuard,
    mesh: MeshEdges,
    loop: Float[np.ndarray, "W 3"],
    displacement: Float[np.ndarray, "W 3"],
    scale: Float[np.ndarray, " S"],
    changed: Bool[np.ndarray, " C"],
    blocks: Blocks,
) -> Bool[np.ndarray, " W"]:
    """Return folded children's corners; after the first round only those that ``changed`` count."""
    touched = np.zeros(len(loop), dtype=bool)
    around = loop, displacement, scale, math.cos(guard.angle)
    args = mesh.faces, mesh.face_edges, mesh.vertex_count, changed

    def look(rows: slice) -> None:
        find_folds(*around, *args, rows.start, rows.stop, touched)

    blocks.run(len(mesh.faces), look)
    return touched
