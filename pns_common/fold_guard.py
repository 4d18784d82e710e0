"""The fold guard G: displacements are scaled back wherever a child face would turn too far.

    q = q0 + s δ        s ∈ {1, ½, ¼, …, 0}, one number for each new vertex

s starts at 1. While a face of q0 + s δ stands at more than its angle to the same face of q0
(Loop's), or has less than a thousandth of its area, s of its three corners is halved, for all such
faces at once. After ROUNDS rounds s of such corners becomes 0: then a face is Loop's own at the
latest when all three have, so it ends. Faces of q0 without area have no direction to turn from:
left out.

The angle of the children of face f is θ; with κ

    min(θ, max(κ β_f, FLAT))        β_f: the largest angle between two faces that share an edge at
                                    a corner of f

where all edges at these corners lie between two faces and are no creases. What is hardly bent is
hardly turned then, however fine the mesh is; else a length that is small for the long edges of a
thin face would be large for the short ones beside it.

So no face turns by more than its angle from Loop's, for any displacements. The rounds know no order
of faces or vertices, and a face is looked at alone: the guard is local and numbering-free, and
commutes with motions, reflections and scaling. s is a number to the gradient: that passes through
s δ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.arrays import Array, as_numpy, beside, cross, detached, dot, gather, namespace
from pns_common.blocks import WHOLE, Blocks
from pns_common.edge.frames import NO_AREA
from pns_common.topology import Topology

ROUNDS = 30
LEAST_AREA = 1e-3
# Radians: turns that are not told from none.
FLAT = 1e-3


@dataclass(frozen=True)
class FoldGuard:
    """No child face turns further from Loop's than it may.

    Attributes:
        angle: θ, radians, 0 < θ < π/2.
        turn_per_bend: κ > 0; None: θ alone.
    """

    angle: float
    turn_per_bend: float | None = None

    def cosines(self, topology: Topology, normals: Float[Array, "F 3"]) -> Float[np.ndarray, " V"]:
        """For each vertex the cosine of how far the faces' children at it may turn, at least.

        Children of a face may turn as far as the least of its corners' cosines says.
        """
        if self.turn_per_bend is None:
            return np.full(topology.vertex_count, math.cos(self.angle))
        return self.cosines_of(bend_cosines(topology, normals))

    def cosines_of(self, bends: Float[np.ndarray, " V"]) -> Float[np.ndarray, " V"]:
        """The same where there is κ, from the cosines of the largest bends."""
        assert self.turn_per_bend is not None
        turns = self.turn_per_bend * np.arccos(np.clip(bends, -1, 1))
        return np.cos(np.minimum(self.angle, np.maximum(turns, FLAT)))

    def __call__(
        self,
        faces: Int[np.ndarray, "F 3"],
        loop: Float[Array, "V 3"],
        displacement: Float[Array, "V 3"],
        blocks: Blocks = WHOLE,
        first: Bool[np.ndarray, " V"] | None = None,
        cosines: Float[np.ndarray, " F"] | None = None,
    ) -> Float[np.ndarray, " V"]:
        """s for each new vertex.

        Args:
            faces: those of the split mesh.
            loop: where Loop puts its vertices.
            displacement: what is added to them.
            blocks: how rows are divided.
            first: vertices whose displacements are settled as if there were no others, and stay;
                None where all are settled together.
            cosines: of how far each face may turn; None: of θ.
        """
        loop, displacement = detached(loop), detached(displacement)
        if cosines is None:
            cosines = np.full(len(faces), math.cos(self.angle))
        mesh = (faces, cosines, loop, displacement)
        everywhere = np.ones(len(loop), dtype=bool)
        if first is None:
            return self._settled(*mesh, np.ones(len(loop)), everywhere, blocks)
        alone = self._settled(*mesh, first.astype(float), first, blocks)
        return self._settled(*mesh, np.where(first, alone, 1.0), ~first, blocks)

    def _settled(
        self,
        faces: Int[np.ndarray, "F 3"],
        cosines: Float[np.ndarray, " F"],
        loop: Float[Array, "V 3"],
        displacement: Float[Array, "V 3"],
        scale: Float[np.ndarray, " V"],
        free: Bool[np.ndarray, " V"],
        blocks: Blocks,
    ) -> Float[np.ndarray, " V"]:
        """Lower s of free vertices until no face is folded; with theirs at 0 none may be."""
        watched, rounds = np.arange(len(faces)), 0
        while len(watched):
            looked_at = faces[watched], cosines[watched]
            folded = self._folded(*looked_at, loop, displacement, scale, blocks)
            corners = faces[watched[folded]].reshape(-1)
            touched = np.zeros(len(scale), dtype=bool)
            # A face that is Loop's own already has nothing left to give (only NaN comes here).
            touched[corners[scale[corners] > 0]] = True
            touched &= free
            scale[touched] = scale[touched] / 2 if rounds < ROUNDS else 0.0
            # A face none of whose corners changed stays as it was.
            watched = np.flatnonzero(touched[faces].any(axis=1)) if touched.any() else watched[:0]
            rounds += 1
        return scale

    def _folded(
        self,
        faces: Int[np.ndarray, "N 3"],
        cosines: Float[np.ndarray, " N"],
        loop: Float[Array, "V 3"],
        displacement: Float[Array, "V 3"],
        scale: Float[np.ndarray, " V"],
        blocks: Blocks,
    ) -> Bool[np.ndarray, " N"]:
        moved = loop + beside(loop, scale, loop.dtype)[:, None] * displacement

        def look(rows: slice) -> tuple[np.ndarray]:
            return (as_numpy(turned(faces[rows], loop, moved, cosines[rows])),)

        (folded,) = blocks.gather(len(faces), look)
        return folded


def turned(
    faces: Int[np.ndarray, "N 3"],
    before: Float[Array, "V 3"],
    after: Float[Array, "V 3"],
    cosines: Float[np.ndarray, " N"],
) -> Bool[Array, " N"]:
    """Whether a face turned by more than arccos(cosines), or shrank to a thousandth of its area.

    False where it had no area before.
    """
    xp = namespace(before)
    old, has_area = _area_vectors(faces, before)
    new, _ = _area_vectors(faces, after)
    old_square, new_square = dot(old, old), dot(new, new)
    size = xp.sqrt(old_square) * xp.sqrt(new_square)
    kept = (dot(old, new) >= beside(before, cosines, before.dtype) * size) & (
        new_square >= LEAST_AREA**2 * old_square
    )
    return has_area & ~kept


def bend_cosines(topology: Topology, normals: Float[Array, "F 3"]) -> Float[np.ndarray, " V"]:
    """For each vertex the cosine of the largest bend of an edge at it.

    −1 where one of these is not interior, or a face has no normal: there is no bend to hold to.
    """
    normals = as_numpy(detached(normals))
    edges = np.full(len(topology.edges), -1.0)
    first, second = normals[topology.edge_faces[topology.interior].T]
    defined = (dot(first, first) > 0) & (dot(second, second) > 0)
    edges[topology.interior] = np.where(defined, dot(first, second), -1.0)
    least = np.ones(topology.vertex_count)
    np.minimum.at(least, topology.edges.reshape(-1), np.repeat(edges, 2))
    return least


def _area_vectors(
    faces: Int[np.ndarray, "N 3"], points: Float[Array, "V 3"]
) -> tuple[Float[Array, "N 3"], Bool[Array, " N"]]:
    """Twice the area vectors, and whether they are more than rounding."""
    a, b, c = (gather(points, faces[:, corner]) for corner in range(3))
    u, v = b - a, c - a
    area = cross(u, v)
    return area, dot(area, area) > (NO_AREA * (dot(u, u) + dot(v, v))) ** 2
