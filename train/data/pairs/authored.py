"""Control meshes as modellers make them for a subdivision surface: few quads, cut into triangles.

Boxes joined on an uneven grid, smoothed as Catmull–Clark smooths (or a little less), bent and
roughened. Their surface is Loop's own: they were drawn with its shrinking in view.
"""

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh, loop
from train.data.pairs.faceted import block
from train.data.pairs.grid import vertex_normals
from train.data.pairs.references import AUTHORED, Pair, Reference
from train.refining import refine

Quads = Int[np.ndarray, "Q 4"]
Points = Float[np.ndarray, "V 3"]

FEWEST, MOST = 24, 1600
# Of edges' mean length, at most.
ROUGHNESS = 0.04

CUTS = {"one way": 0.5, "shorter": 0.3, "at random": 0.2}
SURFACE_LEVELS = 2


def authored_pair(rng: np.random.Generator) -> Pair | None:
    """Return a control mesh with Loop's surface; None where the blocks gave none of fair size."""
    made = block(rng)
    if made is None:
        return None
    points, faces = made
    quads = np.concatenate([faces[::2], faces[1::2, 2:]], axis=1)
    if (faces[::2, [0, 2]] != faces[1::2, :2]).any():
        return None
    for _ in range(int(rng.integers(0, 3))):
        if 8 * len(quads) <= MOST:
            points, quads = _catmull_clark(points, quads)
    for _ in range(int(rng.integers(1, 4))):
        points = _relaxed(points, quads)
    points = _bent(points, rng)
    sides = points[np.roll(quads, -1, axis=1)] - points[quads]
    length = float(np.linalg.norm(sides, axis=2).mean())
    points = points + rng.uniform(0, ROUGHNESS) * length * rng.normal(size=points.shape)
    mesh = Mesh(points, _cut(points, quads, rng))
    if not FEWEST <= len(mesh.faces) <= MOST:
        return None
    fine = refine(mesh, loop(), SURFACE_LEVELS, limit=True).mesh
    return Pair(AUTHORED, mesh, Reference(fine.vertices, vertex_normals(fine)))


def _catmull_clark(points: Points, quads: Quads) -> tuple[Points, Quads]:
    """Return one level of Catmull and Clark's subdivision (1978) of a closed mesh of quads."""
    edges, number = _edges(quads)
    middles = points[quads].mean(axis=1)
    beside = np.zeros((len(edges), 3))
    np.add.at(beside, number.reshape(-1), np.repeat(middles, 4, axis=0))
    on_edges = (points[edges].sum(axis=1) + beside) / 4
    valence = np.bincount(edges.reshape(-1), minlength=len(points))[:, None]
    around, along = np.zeros_like(points), np.zeros_like(points)
    np.add.at(around, quads.reshape(-1), np.repeat(middles, 4, axis=0))
    np.add.at(along, edges.reshape(-1), np.repeat(points[edges].mean(axis=1), 2, axis=0))
    moved = (around / valence + 2 * along / valence + (valence - 3) * points) / valence
    on_edge = len(points) + number
    centre = len(points) + len(edges) + np.arange(len(quads))
    rings = [
        np.stack([quads[:, k], on_edge[:, k], centre, on_edge[:, k - 1]], axis=1) for k in range(4)
    ]
    return np.concatenate([moved, on_edges, middles]), np.concatenate(rings)


def _relaxed(points: Points, quads: Quads) -> Points:
    """Return all points half way to the mean of their neighbours."""
    edges, _ = _edges(quads)
    total = np.zeros_like(points)
    np.add.at(total, edges.reshape(-1), points[edges[:, ::-1]].reshape(-1, 3))
    valence = np.bincount(edges.reshape(-1), minlength=len(points))[:, None]
    return (points + total / valence) / 2


def _edges(quads: Quads) -> tuple[Int[np.ndarray, "E 2"], Int[np.ndarray, "Q 4"]]:
    """Return all edges, and which of them each quad's sides are."""
    sides = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, number = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    return edges, number.reshape(quads.shape)


def _bent(points: Points, rng: np.random.Generator) -> Points:
    """Return points moved by a few long waves."""
    size = float(np.ptp(points, axis=0).max())
    for _ in range(2):
        wave, turn = rng.normal(size=3) / size, rng.uniform(0, 2 * np.pi)
        push = rng.uniform(0, 0.08) * size * rng.normal(size=3)
        points = points + np.sin(2 * points @ wave + turn)[:, None] * push
    return points


def _cut(points: Points, quads: Quads, rng: np.random.Generator) -> Int[np.ndarray, "F 3"]:
    """Return the quads' triangles."""
    cut = str(rng.choice(list(CUTS), p=list(CUTS.values())))
    first, second = (
        np.linalg.norm(points[quads[:, k]] - points[quads[:, k + 2]], axis=1) for k in range(2)
    )
    turned = {
        "one way": np.zeros(len(quads), dtype=bool),
        "shorter": second < first,
        "at random": rng.random(len(quads)) < 0.5,
    }[cut]
    quads = np.where(turned[:, None], np.roll(quads, -1, axis=1), quads)
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
