"""Exact parts of OpenCascade, tessellated and simplified."""

from collections.abc import Iterator

import numpy as np

from pns_common import Mesh
from train.connectivity import connect
from train.data.dense_meshes import is_manifold
from train.data.pairs.references import Coarsen, Pair, Reference, coarsened
from train.surfaces.brep import Tessellation, tessellated
from train.surfaces.machined import machined_part
from train.surfaces.solids import random_rotation
from train.vectors import norm, unit

# Chords' deflection, over a part's size about; angles between them, as printers' files have them.
DEFLECTION, ANGLES = 0.004, (0.12, 0.35)

# Angles of the coarse mesh that is no simplification but a tessellation with few faces.
DRAWN_ANGLES = (0.35, 0.8)

# How often long sides are split before the mesh is simplified, to so much of the part's diagonal.
SPLIT, LONGEST = 0.6, (0.03, 0.12)

# Points of the true surface.
SAMPLES = 12_000

FEWEST, MOST = 120, 2400
MOST_DENSE = 40_000
# Coarse meshes made of one part.
EACH = 4


def machined_pairs(rng: np.random.Generator, coarsen: Coarsen = coarsened) -> Iterator[Pair]:
    """Yield coarse meshes of one random part, closed manifolds all."""
    shape = machined_part(rng)
    part = tessellated(shape, DEFLECTION, rng.uniform(*ANGLES))
    dense = Mesh(part.vertices, part.faces)
    if not is_manifold(dense) or len(dense.faces) > MOST_DENSE:
        return
    turn = random_rotation(rng)
    surface = _sampled(part, rng)
    surface = Reference(surface.points @ turn, surface.normals @ turn)
    if rng.random() < SPLIT:
        dense = _split(dense, float(rng.uniform(*LONGEST)))
    drawn = tessellated(shape, 1.0, rng.uniform(*DRAWN_ANGLES))
    coarse = Mesh(drawn.vertices @ turn, drawn.faces)
    if len(coarse.faces) <= MOST and is_manifold(coarse):
        yield Pair("machined", coarse, surface)
    most = min(MOST, len(dense.faces) // 2)
    for _ in range(EACH if most > FEWEST else 0):
        count = int(np.exp(rng.uniform(np.log(FEWEST), np.log(most))))
        coarse = coarsen(dense.vertices @ turn, dense.faces, count, rng)
        if coarse is not None:
            yield Pair("machined", coarse, surface)


def _sampled(part: Tessellation, rng: np.random.Generator) -> Reference:
    """Return points spread evenly by area, with exact normals interpolated in their triangles."""
    corners = part.vertices[part.faces]
    area = norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    face = rng.choice(len(part.faces), SAMPLES, p=area / area.sum())
    u, v = np.sort(rng.random((2, SAMPLES)), axis=0)
    weights = np.stack([u, v - u, 1 - v], axis=1)[..., None]
    points, normals = ((weights * values[face]).sum(axis=1) for values in (corners, part.normals))
    return Reference(points, unit(normals))


def _split(mesh: Mesh, longest: float) -> Mesh:
    """Halve sides until none is longer than so much of the diagonal, or faces are many."""
    limit = longest * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    vertices, faces = mesh.vertices, mesh.faces
    while len(faces) < MOST_DENSE / 2:
        level = connect(faces, len(vertices))
        edges, sides = level.edges.numpy(), level.face_edges.numpy()
        length = norm(vertices[edges[:, 1]] - vertices[edges[:, 0]])
        # Only a longest side of both its faces is halved: no face has two that are.
        longest_side = sides[np.arange(len(faces)), length[sides].argmax(axis=1)]
        votes = np.bincount(longest_side, minlength=len(edges))
        halved = (length > limit) & (votes == np.bincount(sides.reshape(-1)))
        if not halved.any():
            return Mesh(vertices, faces)
        middle = np.full(len(edges), -1)
        middle[halved] = len(vertices) + np.arange(int(halved.sum()))
        vertices = np.concatenate([vertices, vertices[edges[halved]].mean(axis=1)])
        place = middle[sides]
        side = place.argmax(axis=1)
        rows = np.flatnonzero(place.max(axis=1) >= 0)
        a, b, c = (faces[rows, (side[rows] + k) % 3] for k in range(3))
        m = place[rows, side[rows]]
        kept = np.delete(faces, rows, axis=0)
        faces = np.concatenate([kept, np.c_[a, m, c], np.c_[m, b, c]])
    return Mesh(vertices, faces)
