"""The fold guard G: displacements are scaled back wherever a child face would turn too far.

    q = q0 + s δ        s ∈ {1, ½, ¼, …, 0}, one number for each new vertex

s starts at 1. While a face of q0 + s δ stands at more than θ to the same face of q0 (Loop's), or
has less than a thousandth of its area, s of its three corners is halved, for all such faces at
once. After ROUNDS rounds s of such corners becomes 0: then a face is Loop's own at the latest when
all three have, so it ends. Faces of q0 without area have no direction to turn from: left out.

A boundary that pieces share goes where they meet again, whatever lies inside. So s of its vertices
is halved only by faces that it would fold by itself: where the inside goes along with it, and
nothing is folded, it stays as well.

So no face turns by more than θ from Loop's, for any displacements. The rounds know no order of
faces or vertices, and a face is looked at alone: the guard is local and numbering-free, and
commutes with motions, reflections and scaling. s is a number to the gradient: that passes through
s δ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import Array, as_numpy, beside, cross, detached, dot, gather, namespace
from pns_common.base.blocks import WHOLE, Blocks
from pns_common.geometry.frames import NO_AREA

ROUNDS = 30
LEAST_AREA = 1e-3


@dataclass(frozen=True)
class FoldGuard:
    """No child face turns by more than ``angle`` radians, 0 < angle < π/2, from Loop's."""

    angle: float

    def __call__(
        self,
        faces: Int[np.ndarray, "F 3"],
        loop: Float[Array, "V 3"],
        displacement: Float[Array, "V 3"],
        blocks: Blocks = WHOLE,
        shared: Bool[np.ndarray, " V"] | None = None,
    ) -> Float[np.ndarray, " V"]:
        """Return s for each new vertex.

        Args:
            faces: those of the split mesh.
            loop: where Loop puts its vertices.
            displacement: what is added to them.
            blocks: how rows are divided.
            shared: vertices of boundaries, which stay but for what they would fold by themselves;
                None where all vertices are alike.
        """
        loop, displacement = detached(loop), detached(displacement)
        shared = np.zeros(len(loop), dtype=bool) if shared is None else shared
        scale, watched, rounds = np.ones(len(loop)), faces, 0
        while len(watched):
            folded = watched[self._folded(watched, loop, displacement, scale, blocks)]
            corners = folded.reshape(-1)
            if shared.any():
                by_itself = np.where(shared, scale, 0.0)
                alone = self._folded(folded, loop, displacement, by_itself, blocks)
                corners = folded[alone[:, None] | ~shared[folded]]
            touched = np.zeros(len(scale), dtype=bool)
            # A face that is Loop's own already has nothing left to give (only NaN comes here).
            touched[corners[scale[corners] > 0]] = True
            scale[touched] = scale[touched] / 2 if rounds < ROUNDS else 0.0
            # A face none of whose corners changed stays as it was.
            watched = faces[touched[faces].any(axis=1)] if touched.any() else faces[:0]
            rounds += 1
        return scale

    def _folded(
        self,
        faces: Int[np.ndarray, "N 3"],
        loop: Float[Array, "V 3"],
        displacement: Float[Array, "V 3"],
        scale: Float[np.ndarray, " V"],
        blocks: Blocks,
    ) -> Bool[np.ndarray, " N"]:
        moved = loop + beside(loop, scale, loop.dtype)[:, None] * displacement
        cosine = math.cos(self.angle)

        def look(rows: slice) -> tuple[np.ndarray]:
            return (as_numpy(turned(faces[rows], loop, moved, cosine)),)

        (folded,) = blocks.gather(len(faces), look)
        return folded


def turned(
    faces: Int[np.ndarray, "N 3"],
    before: Float[Array, "V 3"],
    after: Float[Array, "V 3"],
    cosine: float,
) -> Bool[Array, " N"]:
    """Return whether a face turned by more than arccos(cosine), or lost all but 1/1000 of its area.

    False where it had no area before.
    """
    xp = namespace(before)
    old, has_area = _area_vectors(faces, before)
    new, _ = _area_vectors(faces, after)
    old_square, new_square = dot(old, old), dot(new, new)
    size = xp.sqrt(old_square) * xp.sqrt(new_square)
    kept = (dot(old, new) >= cosine * size) & (new_square >= LEAST_AREA**2 * old_square)
    return has_area & ~kept


def _area_vectors(
    faces: Int[np.ndarray, "N 3"], points: Float[Array, "V 3"]
) -> tuple[Float[Array, "N 3"], Bool[Array, " N"]]:
    """Return twice the area vectors, and whether they are more than rounding."""
    a, b, c = (gather(points, faces[:, corner]) for corner in range(3))
    u, v = b - a, c - a
    area = cross(u, v)
    return area, dot(area, area) > (NO_AREA * (dot(u, u) + dot(v, v))) ** 2
