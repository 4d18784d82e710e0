"""Faces with new vertices on their sides, and triangles that fill them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.mesh.rows import cross, dot, ragged
from pns_common.mesh.topology import TRIANGLE

# Shapes of triangles that differ by less are equal: networks compute in single precision.
EQUAL = 1e-4
# Of equal ones that counts which is farthest this way, in which few meshes have symmetries.
WAY = np.array([0.8429, 0.4713, 0.2593])


@dataclass(frozen=True, eq=False)
class Outlines:
    """Faces with the new vertices on their sides.

    Attributes:
        names: vertices, face after face.
        at: where each is: k + t on the side from corner k on.
        offsets: where those of each face begin.
    """

    names: Integer[np.ndarray, " M"]
    at: Float[np.ndarray, " M"]
    offsets: Integer[np.ndarray, " N1"]

    @property
    def owner(self) -> Integer[np.ndarray, " M"]:
        """Return the face of each vertex."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    def some(self, rows: Integer[np.ndarray, " K"]) -> Outlines:
        """Return those of some faces."""
        places, offsets = ragged(self.offsets, rows)
        return Outlines(self.names[places], self.at[places], offsets)


@dataclass(frozen=True, eq=False)
class Written:
    """Written faces of one level.

    Attributes:
        names, at: vertices of their corners and where these are on the outline of the face.
        counts: how many corners each has.
        distances, turns, codes: of the faces that they are or are cut from.
    """

    names: Integer[np.ndarray, " H"]
    at: Float[np.ndarray, " H"]
    counts: Integer[np.ndarray, " F"]
    distances: Float[np.ndarray, " F"]
    turns: Float[np.ndarray, " F"]
    codes: Integer[np.ndarray, " F"]


def triangles_in(
    at: Float[np.ndarray, "N M"],
    points: Float[np.ndarray, "N M 3"],
    normals: Float[np.ndarray, "N 3"],
) -> tuple[Integer[np.ndarray, "N T 3"], Bool[np.ndarray, " N"]]:
    """Return triangles that fill outlines of triangles, and which have two fillings as good.

    Triangles are places of their corners on the outline. Corners are cut off one by one, where the
    piece is least a sliver. No piece lies within a side.
    """
    size, new = int(at.shape[1]), at % 1 > 0
    # Where one side alone has new vertices, a fan from the corner opposite.
    last, first = (np.where(new, at, none).astype(np.int64) for none in (-1, TRIANGLE))
    side, tied = last.max(axis=1), np.zeros(len(at), dtype=bool)
    begin = (at == np.where(side < 0, 0, (side + 2) % TRIANGLE)[:, None]).argmax(axis=1)
    made = (begin[:, None, None] + [[0, k + 1, k + 2] for k in range(size - 2)]) % size
    rest = np.flatnonzero(side > first.min(axis=1))
    if len(rest):
        towards = points[rest] @ WAY
        towards, twice = np.concatenate([towards, -towards]), np.tile(rest, 2)
        found = _cut_off(at[twice], points[twice], normals[twice], towards)
        keys = np.sort(np.sort(found) @ [1, size, size**2])
        made[rest] = found[: len(rest)]
        tied[rest] = np.any(keys[: len(rest)] != keys[len(rest) :], axis=1)
    return made, tied


def _cut_off(
    at: Float[np.ndarray, "N M"],
    points: Float[np.ndarray, "N M 3"],
    normals: Float[np.ndarray, "N 3"],
    towards: Float[np.ndarray, "N M"],
) -> Integer[np.ndarray, "N T 3"]:
    count, size = len(at), int(at.shape[1])
    every, place = np.arange(count), np.zeros((count, 1), dtype=np.int64) + np.arange(size)
    side = at.astype(np.int64)
    # Corners lie on two sides.
    on = (np.arange(TRIANGLE) == side[:, :, None]) | (
        (at == side)[:, :, None] & (np.arange(TRIANGLE) == (side[:, :, None] - 1) % TRIANGLE)
    )
    made = np.empty((count, size - 2, 3), dtype=np.int64)
    for step in range(size - TRIANGLE):
        left = size - step
        three = np.stack([np.roll(place, 1, axis=1), place, np.roll(place, -1, axis=1)], axis=2)
        a, b, c = points[every[:, None, None], three].transpose(2, 0, 1, 3).reshape(3, -1, 3)
        area = dot(cross(b - a, c - a), np.repeat(normals, left, axis=0))
        longest = np.maximum.reduce([dot(u, u) for u in (b - a, c - b, a - c)])
        shape = (area / np.where(longest > 0, longest, 1.0)).reshape(count, left)
        there = on[every[:, None], place]
        flat = on[every[:, None, None], three].all(axis=2).any(axis=2)
        # What is left would lie within a side.
        flat |= (there.sum(axis=1)[:, None] - there == left - 1).any(axis=2)
        shape[flat] = -np.inf
        best = shape >= shape.max(axis=1, keepdims=True) - EQUAL
        tip = np.where(best, towards[every[:, None], place], -np.inf).argmax(axis=1)
        made[:, step] = three[every, tip]
        place = place[np.arange(left) != tip[:, None]].reshape(count, left - 1)
    made[:, -1] = place
    return made
