"""One look at a whole mesh, block by block: is it sound, how large is it, where does it lie?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import norm
from pns_common.base.extent import extent
from pns_common.geometry.side_lengths import BLOCK_FACES, SideLengths
from pns_common.mesh import LARGEST_COORDINATE, SMALLEST_EXTENT

from ...errors import UnrefinableError
from .arrays import ArrayMesh, blocks_of, let_go

# Faces whose sides are measured at once: whole blocks, so that sums are those of the whole mesh.
SIDE_ROWS = 64 * BLOCK_FACES


@dataclass(frozen=True)
class Survey:
    """What is known of the whole mesh.

    Attributes:
        reference_length: R, as ``refine`` measures it, bit for bit.
        sides: of the faces, as ``measure_sides`` has them, bit for bit.
        low, high: the corners of the box around the faces' vertices.
        isolated: vertices that no face uses.
    """

    vertices: int
    faces: int
    reference_length: float
    sides: SideLengths
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    isolated: int


def survey(mesh: ArrayMesh) -> Survey:
    """Check a mesh as ``Mesh`` does, and measure it.

    Raises:
        UnrefinableError: no faces, an index out of range, a coordinate that is no number or too
            large, or an extent too small to compute with.
    """
    used = used_vertices(mesh)
    total, count = np.zeros(3), 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    inner_low, inner_high = low.copy(), high.copy()
    for rows in blocks_of(len(mesh.positions)):
        points = _checked(mesh, rows)
        least, most = extent(points)
        low, high = np.minimum(low, least), np.maximum(high, most)
        points = points[used[rows]]
        if len(points):
            # One after the other, in the order of their numbers, as the mean of all is taken.
            total = np.cumsum(np.concatenate([total[None], points]), axis=0)[-1]
            count += len(points)
            least, most = extent(points)
            inner_low, inner_high = np.minimum(inner_low, least), np.maximum(inner_high, most)
        let_go(mesh.positions)
    longest = (high - low).max()
    if 0 < longest < SMALLEST_EXTENT:
        raise UnrefinableError(f"extent {longest:g}, expected at least {SMALLEST_EXTENT:g}")
    centre, largest = total / count, 0.0
    for rows in blocks_of(len(mesh.positions)):
        points = np.asarray(mesh.positions[rows][used[rows]], dtype=np.float64)
        largest = max(largest, float(norm(points - centre).max(initial=0)))
        let_go(mesh.positions)
    sides = SideLengths()
    for rows in blocks_of(len(mesh.faces), SIDE_ROWS):
        sides = sides.with_faces(mesh.positions, mesh.faces[rows])
        let_go(mesh.faces, mesh.positions)
    return Survey(
        len(mesh.positions),
        len(mesh.faces),
        largest / math.sqrt(2),
        sides,
        _triple(inner_low),
        _triple(inner_high),
        len(used) - count,
    )


def used_vertices(mesh: ArrayMesh) -> np.ndarray:
    """Return which vertices some face uses.

    Raises:
        UnrefinableError: no faces, or an index out of range.
    """
    if len(mesh.faces) == 0:
        raise UnrefinableError("no faces to refine")
    used = np.zeros(len(mesh.positions), dtype=bool)
    for rows in blocks_of(len(mesh.faces)):
        faces = mesh.faces[rows]
        if not (faces.min() >= 0 and faces.max() < len(used)):
            inside = ((faces >= 0) & (faces < len(used))).all(axis=1)
            worst = int(np.argmin(inside))
            raise UnrefinableError(
                f"face {rows.start + worst}: indices {faces[worst].tolist()}, "
                f"expected 0 … {len(used) - 1}"
            )
        used[faces.reshape(-1)] = True
        let_go(mesh.faces)
    return used


def _checked(mesh: ArrayMesh, rows: slice) -> Float[np.ndarray, "N 3"]:
    points = np.asarray(mesh.positions[rows], dtype=np.float64)
    fits = np.abs(points) <= LARGEST_COORDINATE  # also where it is NaN
    if not fits.all():
        worst = int(np.argmin(fits.all(axis=1)))
        raise UnrefinableError(
            f"vertex {rows.start + worst}: coordinates {points[worst].tolist()}, "
            f"expected finite numbers up to {LARGEST_COORDINATE:g}"
        )
    return points


def _triple(values: Float[np.ndarray, " N"]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
