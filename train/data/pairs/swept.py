"""Parts of machined surfaces: straight pieces and arcs, drawn along a line or turned round an axis.

They bend one way far more than the other, or not at all. Modellers' grids and quadric collapses
leave faces there that are many times as long as they are wide, beside nearly even ones.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.data.pairs.grid import Parametrised, cut_quads, random_cut, vertex_normals
from train.data.pairs.references import SMOOTH, SWEPT, Pair, Reference, coarsened
from train.surfaces.solids import random_rotation

# Pieces of a profile, from and below; how often one is straight, but for one that never is.
PIECES, STRAIGHT = (1, 6), 0.4

# Of straight pieces and of arcs, even by logarithm; the arcs' angles in radians.
LENGTHS, RADII, TURNS = (0.1, 1.0), (0.06, 0.8), (0.35, 2.2)

# Beyond this angle from the axis's right a profile turns back, so that it does not meet itself.
FARTHEST_TURN = np.pi / 2

# How often it is drawn along a line; and, where it is not, turned all the way round.
DRAWN, WHOLE = 0.35, 0.35

# The line's length, or the inner radius, over the profile's extent.
SIZES = (0.15, 3.0)

# Of each axis: circles become ellipses, so that no torus and no sphere is among these surfaces.
SQUEEZED = (0.6, 1.5)

# Rows and columns of the dense mesh, about.
FINE = 150

# How often the coarse mesh is a grid; else it is the dense one, coarsened.
GRIDS = 0.4

FEWEST, MOST = 120, 1600
ARC_ROWS, STRAIGHT_ROWS, COLUMNS = (1, 7), (1, 3), (4, 80)


@dataclass(frozen=True, eq=False)
class Profile:
    """A plane curve of K pieces, each straight or an arc, each going on where the last one pointed.

    Attributes:
        bends: of each piece, its curvature; to the left it is positive.
        starts: arc length where each begins, and where the last ends.
        corners, headings: points and directions (angles) there.
    """

    bends: Float[np.ndarray, " K"]
    starts: Float[np.ndarray, " L"]
    corners: Float[np.ndarray, "L 2"]
    headings: Float[np.ndarray, " L"]

    def at(self, along: Float[np.ndarray, " N"]) -> Float[np.ndarray, "N 2"]:
        """Return points at arc lengths."""
        piece = np.searchsorted(self.starts, along, side="right") - 1
        piece = np.clip(piece, 0, len(self.bends) - 1)
        gone = along - self.starts[piece]
        # A chord points half way between the headings of its ends.
        half = self.bends[piece] * gone / 2
        heading = self.headings[piece] + half
        way = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        return self.corners[piece] + (gone * np.sinc(half / np.pi))[:, None] * way


def random_profile(rng: np.random.Generator) -> Profile:
    """Return a curve of one to five pieces."""
    count = int(rng.integers(*PIECES))
    straight = rng.random(count) < STRAIGHT
    straight[rng.integers(count)] = False
    radius, turn = _log_uniform(rng, RADII, count), rng.uniform(*TURNS, count)
    length = np.where(straight, _log_uniform(rng, LENGTHS, count), radius * turn)
    starts, headings = np.append(0.0, np.cumsum(length)), np.zeros(count + 1)
    headings[0] = rng.uniform(-1, 1) * FARTHEST_TURN
    corners, bends = np.zeros((count + 1, 2)), np.zeros(count)
    for k in range(count):
        away = abs(headings[k]) > FARTHEST_TURN
        side = -np.sign(headings[k]) if away else rng.choice([-1.0, 1.0])
        bends[k] = 0.0 if straight[k] else side / radius[k]
        so_far = Profile(bends[: k + 1], starts[: k + 1], corners[: k + 1], headings[: k + 1])
        corners[k + 1] = so_far.at(starts[k + 1 : k + 2])[0]
        headings[k + 1] = headings[k] + bends[k] * length[k]
    return Profile(bends, starts, corners, headings)


def swept_pair(rng: np.random.Generator) -> Pair | None:
    """Return a coarse mesh on a random swept profile; None where collapses spoilt it."""
    profile = random_profile(rng)
    point_at, closes = _random_sweep(profile, rng)
    fine = _grid(point_at, np.linspace(0, profile.starts[-1], FINE), FINE, closes, rng)
    turn = random_rotation(rng)
    if rng.random() < GRIDS:
        rows = _rows(profile, rng)
        most = min(COLUMNS[1], MOST // (2 * len(rows)))
        coarse = _grid(point_at, rows, int(rng.integers(COLUMNS[0], most)), closes, rng)
    else:
        count = int(_log_uniform(rng, (FEWEST, MOST), 1)[0])
        coarse = coarsened(fine.vertices, fine.faces, count, rng)
    if coarse is None:
        return None
    surface = Reference(fine.vertices @ turn, vertex_normals(fine) @ turn)
    return Pair(SWEPT, Mesh(coarse.vertices @ turn, coarse.faces), surface, SMOOTH)


def _random_sweep(profile: Profile, rng: np.random.Generator) -> tuple[Parametrised, bool]:
    """Return points at (arc length, share of the sweep), and whether that closes."""
    squeezed = rng.uniform(*SQUEEZED, 3)
    fine = profile.at(np.linspace(0, profile.starts[-1], FINE))
    extent = float(np.ptp(fine, axis=0).max())
    size = float(_log_uniform(rng, SIZES, 1)[0]) * extent
    drawn, closes = rng.random() < DRAWN, rng.random() < WHOLE

    def along_a_line(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        x, z = profile.at(u).T
        return np.stack([x, -size * v, z], axis=1) * squeezed

    if drawn:
        return along_a_line, False
    angle = 2 * np.pi if closes else rng.uniform(0.3, 1.9 * np.pi)
    inside = fine[:, 0].min() - size

    def round_an_axis(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        x, z = profile.at(u).T
        radius = x - inside
        return (
            np.stack([radius * np.cos(angle * v), -radius * np.sin(angle * v), z], axis=1)
            * squeezed
        )

    return round_an_axis, closes


def _grid(
    point_at: Parametrised,
    rows: Float[np.ndarray, " R"],
    columns: int,
    closes: bool,
    rng: np.random.Generator,
) -> Mesh:
    across = np.arange(columns if closes else columns + 1) / columns
    u, v = (axis.ravel() for axis in np.meshgrid(rows, across, indexing="ij"))
    number = np.arange(len(u)).reshape(len(rows), -1)
    number = np.c_[number, number[:, :1]] if closes else number
    return Mesh(point_at(u, v), cut_quads(number, random_cut(len(rows) - 1, columns, rng)))


def _rows(profile: Profile, rng: np.random.Generator) -> Float[np.ndarray, " R"]:
    """Return arc lengths of a grid's lines: all ends of pieces, and some between."""
    rows = [profile.starts[:1]]
    for bend, start, end in zip(profile.bends, profile.starts, profile.starts[1:], strict=False):
        count = int(rng.integers(*(ARC_ROWS if bend else STRAIGHT_ROWS)))
        rows.append(np.linspace(start, end, count + 1)[1:])
    return np.concatenate(rows)


def _log_uniform(
    rng: np.random.Generator, ends: tuple[float, float], count: int
) -> Float[np.ndarray, " N"]:
    low, high = np.log(ends)
    return np.exp(rng.uniform(low, high, count))
