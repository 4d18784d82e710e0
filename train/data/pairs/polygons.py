"""Coarse meshes of quads, with triangles and n-gons among them, and the stream of all.

Dense shapes are remeshed in quads (Jakob et al. 2015, "Instant field-aligned meshes") and their
vertices laid onto the shape; cages are split; triangles of all other pairs are joined in quads and
flat parts of them in n-gons, as modellers draw.
"""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pns_common import Mesh, MeshError, catmull_clark, refine
from pns_common.kernels.connectivity import pair_up
from pns_common.mesh.topology import EdgeClass
from train.connectivity import connect, next_corner
from train.data.pairs.faceted import block, faceted_pair
from train.data.pairs.grid import grid_pair, vertex_normals
from train.data.pairs.lathe import lathe_pair
from train.data.pairs.machined import machined_pairs
from train.data.pairs.pair_stream import drawn_pairs
from train.data.pairs.references import Pair, Reference, coarsened, patch_pair, sphere_pair
from train.data.pairs.solid import solid_pairs
from train.data.remeshers import instant, laid_onto, with_points
from train.data.simplifiers import Simplifier, isotropic
from train.vectors import dot, face_normals, unit

# How often a dense shape is remeshed in quads; else it is simplified and triangles are joined.
REMESHED = 0.65
MOST_SMOOTHED = 3

# How often vertices are laid onto the shape, where triangles were joined.
LAID = 0.5

# Corners of a joined quad have angles with cosines up to this.
SKEWED = 0.8

# How often flat parts become n-gons, and their corners at most.
FLAT_PARTS, MOST_CORNERS = 0.6, 40

# Faces that turn by less lie in one plane, radians.
IN_PLANE = 1e-4

# Of a cage: levels to the coarse mesh, and to the surface; its vertices' noise.
SPLITS, FINE_SPLITS, NOISE = (1, 1, 2), 4, 0.08

FEWEST, MOST = 12, 1200


def polygon_stream(seed: int) -> Iterator[Pair]:
    """Yield all pairs of a seed, without end: centred, with reference length R = 1."""
    singles = {
        patch_pair: 0.04,
        grid_pair: 0.12,
        cage_pair: 0.08,
        partial(sphere_pair, coarsen=remeshed): 0.04,
        faceted_pair: 0.08,
        lathe_pair: 0.30,
    }
    several = {
        partial(machined_pairs, coarsen=remeshed): 0.14,
        partial(solid_pairs, coarsen=remeshed): 0.20,
    }
    rng = np.random.default_rng(seed)
    for pair in drawn_pairs(rng, singles, several):
        mesh = in_polygons(pair.coarse, rng)
        if FEWEST <= mesh.face_count <= MOST and is_manifold(mesh):
            yield Pair(pair.kind, mesh, pair.surface)


def remeshed(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    count: int,
    rng: np.random.Generator,
) -> Mesh | None:
    """Return a mesh of quads, as large as one of so many triangles; None where it is spoilt."""
    dense = Mesh(points, faces)
    if rng.random() < REMESHED:
        try:
            mesh = instant(dense, count // 2, int(rng.integers(MOST_SMOOTHED + 1)))
        except MeshError:
            return None
        return mesh if is_manifold(mesh) else None
    mesh = coarsened(points, faces, count, rng)
    if mesh is None:
        return None
    mesh = in_polygons(mesh, rng)
    return laid_onto(dense, mesh) if rng.random() < LAID else mesh


def is_manifold(mesh: Mesh) -> bool:
    """Return whether all edges have one face or two, and all vertices one fan."""
    topology = mesh.topology()
    whole = (topology.edge_class != EdgeClass.IRREGULAR).all()
    return bool(whole) and not topology.multi_fan_vertices.any()


def cage_pair(rng: np.random.Generator) -> Pair | None:
    """Return a split cage of blocks whose vertices lie on its limit."""
    made = block(rng)
    if made is None:
        return None
    cage = in_polygons(Mesh(*made), rng)
    noise = NOISE * np.ptp(cage.vertices, axis=0).min() * rng.normal(size=cage.vertices.shape)
    cage, scheme = with_points(cage, cage.vertices + noise), catmull_clark()
    coarse = refine(cage, scheme, int(rng.choice(SPLITS)), limit=True).mesh
    fine = refine(cage, scheme, FINE_SPLITS, limit=True).mesh.triangulated()
    return Pair("cage", coarse, Reference(fine.vertices, vertex_normals(fine)))


def in_polygons(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Join triangles to quads, the most rectangular first, and now and then flat parts to n-gons.

    Meshes of other faces stay as they are.
    """
    if not mesh.triangles:
        return mesh
    parts, free = _flat_parts(mesh) if rng.random() < FLAT_PARTS else ([], None)
    free = np.ones(mesh.face_count, dtype=bool) if free is None else free
    level, points = connect(mesh.faces, len(mesh.vertices)), mesh.vertices
    corners = level.half_edges[level.paired].numpy()
    starts, ends = mesh.corners[corners].T
    c, d = mesh.corners[next_corner(next_corner(corners))].T
    quads = np.stack([starts, d, ends, c], axis=1)
    sides = np.roll(points[quads], -1, axis=1) - points[quads]
    sides = unit(sides.reshape(-1, 3)).reshape(sides.shape)
    before = np.roll(sides, 1, axis=1)
    normals = face_normals(points, mesh.faces)[corners // 3]
    turns = np.cross(before, sides) @ unit(normals.sum(axis=1))[:, :, None]
    skewed = np.abs((before * sides).sum(axis=2)).max(axis=1)
    bent = 1 - dot(normals[:, 0], normals[:, 1])
    fair = np.flatnonzero((skewed < SKEWED) & (turns[..., 0] > 0).all(axis=1) & (bent < 1))
    rows = fair[np.argsort(skewed[fair] + bent[fair], kind="stable")]
    chosen = np.zeros(len(rows), dtype=bool)
    first, second = np.ascontiguousarray((corners[rows] // 3).T)
    pair_up(first, second, free, chosen)
    return Mesh(points, [*parts, *quads[rows[chosen]], *mesh.faces[free]])


def joined(mesh: Mesh, faces: int) -> Mesh:
    """Remesh to one edge length, and join triangles to quads and flat parts to n-gons.

    Raises:
        MeshError: no face is left.
    """
    triangles = isotropic(mesh, 2 * faces)
    return laid_onto(mesh, in_polygons(triangles, np.random.default_rng(faces)))


REMESHERS: Mapping[str, Simplifier] = {"instant": instant, "joined": joined}


def _flat_parts(mesh: Mesh) -> tuple[list[np.ndarray], np.ndarray]:
    """Return flat parts of three triangles and more, as polygons, and which faces are in none.

    Only discs without a vertex inside are such parts.
    """
    level, normals = (
        connect(mesh.faces, len(mesh.vertices)),
        face_normals(mesh.vertices, mesh.faces),
    )
    first, second = level.half_edges[level.paired].numpy().T // 3
    flat = (normals[first] * normals[second]).sum(axis=1) > np.cos(IN_PLANE)
    joins = coo_array(
        (np.ones(flat.sum()), (first[flat], second[flat])), shape=[mesh.face_count] * 2
    )
    _, part = connected_components(joins, directed=False)
    free, polygons = np.ones(mesh.face_count, dtype=bool), []
    for number in np.flatnonzero(np.bincount(part) > 2):
        own = np.flatnonzero(part == number)
        faces = mesh.faces[own]
        sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        inner = {(b, a) for a, b in sides.tolist()}
        after = {a: b for a, b in sides.tolist() if (a, b) not in inner}
        loop = [next(iter(after))]
        while (following := after.get(loop[-1], loop[0])) != loop[0] and len(loop) <= len(after):
            loop.append(following)
        if len(loop) == len(np.unique(faces)) == len(own) + 2 and len(loop) <= MOST_CORNERS:
            polygons.append(np.array(loop))
            free[own] = False
    return polygons, free
