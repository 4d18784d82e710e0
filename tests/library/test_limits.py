"""Limits of both schemes are where refinement leads; normals are those of the surface there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, catmull_clark, loop, refine
from pns_common.carry.columns import level_topologies, refine_columns
from pns_common.mesh.sectors import find_sectors
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK, LOOP
from pns_common.schemes.limit import limit_normals, limit_positions, limit_shift
from tests.support import opensubdiv
from tests.support.meshes import bent, bumpy_sphere, grid, icosphere, manifolds, soups
from tests.support.polygons import (
    SHAPES,
    polygon_manifolds,
    polygon_soups,
    quad_grid,
    quad_star,
    uneven,
)

over_both = pytest.mark.parametrize("base", [LOOP, CATMULL_CLARK], ids=lambda base: base.name)
MANIFOLDS = {"loop": manifolds(), "catmull-clark": polygon_manifolds()}
ANY = {"loop": manifolds() | soups(), "catmull-clark": polygon_manifolds() | polygon_soups()}
seeds = st.integers(0, 2**31)


def star(k):
    """A vertex with k triangles around it, in a plane."""
    ring, angle = 1 + np.arange(k), 2 * np.pi * np.arange(k) / k
    points = np.zeros((k + 1, 3))
    points[1:, :2] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points, np.stack([0 * ring, ring, np.roll(ring, -1)], axis=1)


def creased(points, faces, pairs=()):
    topology = Mesh(points, faces).topology()
    return topology.with_creases(topology.rows_of(np.array(pairs, dtype=int).reshape(-1, 2)))


def randomly_creased(mesh, seed):
    topology, rng = mesh.topology(), np.random.default_rng(seed)
    return topology.with_creases(np.flatnonzero(rng.random(len(topology.edges)) < 1 / 3))


def stepped(points, topology, base):
    return base.place(points, topology, Blocks()), base.split(topology, Blocks())


# --- positions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [3, 4, 5, 6, 9, 40])
def test_smooth_vertices_follow_loops_formula(k):
    points, faces = star(k)
    points = uneven(points)
    beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
    weight = 1 / (3 / (8 * beta) + k)
    expected = (1 - k * weight) * points[0] + weight * points[1:].sum(axis=0)
    np.testing.assert_allclose(limit_positions(points, creased(points, faces))[0], expected)


@pytest.mark.parametrize("k", [2, 3, 4, 5, 6, 9, 40])
def test_smooth_vertices_have_the_published_mask_of_quads(k):
    """(k² p + 4 Σ e_j + Σ d_j) / (k (k + 5))."""
    points, faces = SHAPES["pillow"] if k == 2 else quad_star(k)
    points = uneven(points, k)
    rings = [np.roll(face, -list(face).index(0)) for face in faces if 0 in face]
    beside = np.unique([ring[j] for ring in rings for j in (1, 3)])
    opposite = [ring[2] for ring in rings]
    expected = k**2 * points[0] + 4 * points[beside].sum(axis=0) + points[opposite].sum(axis=0)
    limit = limit_positions(points, creased(points, faces), base=CATMULL_CLARK)[0]
    np.testing.assert_allclose(limit, expected / (k * (k + 5)), atol=1e-14)


@over_both
@given(data=st.data(), seed=seeds)
def test_a_step_leaves_limits_where_they_are(base, data, seed):
    # The limit of a vertex with an edge to itself is that of the next mesh.
    meshes = ANY["loop"] if base is LOOP else polygon_manifolds() | polygon_soups(repeats=False)
    mesh = data.draw(meshes)
    points = mesh.vertices / np.abs(mesh.vertices).max()
    topology = randomly_creased(mesh, seed)
    limit = limit_positions(*stepped(points, topology, base), base=base)[: len(points)]
    expected = limit_positions(points, topology, base=base)
    np.testing.assert_allclose(limit, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("creases", [[], [[7, 8], [8, 14], [14, 15]]])
@pytest.mark.parametrize(
    ("base", "make", "near"), [(LOOP, grid, 1e-4), (CATMULL_CLARK, quad_grid, 2e-3)]
)
def test_deep_refinement_arrives_there(base, make, near, creases):
    points, faces = make(6, bent)
    named = Creases(np.array(creases, dtype=int).reshape(-1, 2))
    topologies = level_topologies(faces, len(points), 6, named, base)
    deep = refine_columns(points, topologies, base)[: len(points)]
    expected = limit_positions(points, topologies[0], base=base)
    np.testing.assert_allclose(deep, expected, rtol=0, atol=near)


@over_both
@pytest.mark.parametrize("limit", [False, True])
@given(data=st.data(), seed=seeds, soft=st.booleans())
def test_masks_are_means_for_any_sharpness(base, limit, data, seed, soft):
    """All rows are ≥ 0 with sum 1, so bounds on displacements hold on the limit surface."""
    mesh, rng = data.draw(ANY[base.name]), np.random.default_rng(seed)
    topology, unit = randomly_creased(mesh, seed), np.eye(len(mesh.vertices))
    if soft:
        topology = topology.with_sharpness(rng.random(len(topology.edges)))
    rows = (
        limit_positions(unit, topology, base=base)
        if limit
        else base.place(unit, topology, Blocks())
    )
    assert rows.min() >= -1e-15
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-13)


@pytest.mark.parametrize("w", [0.0, 0.3, 1.0])
def test_soft_edges_blend_the_rules(w):
    """Three edges of sharpness 1, w and w / 2."""
    points, faces = star(6)
    points = uneven(points)
    plain = creased(points, faces)
    sharpness = np.zeros(len(plain.edges))
    sharpness[plain.rows_of(np.array([[0, 1], [0, 3], [0, 4]]))] = [1, w, w / 2]
    limit = limit_positions(points, plain.with_sharpness(sharpness))[0]
    dart = limit_positions(points, creased(points, faces, [[0, 1]]))[0]
    curve = (4 * points[0] + points[1] + points[3]) / 6
    expected = (1 - w) * dart + w / 2 * curve + w / 2 * points[0]
    np.testing.assert_allclose(limit, expected, atol=1e-14)


def test_a_crease_moves_limits_as_far_as_is_said():
    points, faces = bumpy_sphere()
    smooth = creased(points, faces)
    assert limit_shift(points, smooth) == 0.0
    sharp = creased(points, faces, [faces[0, :2], faces[0, 1:]])
    moved = limit_positions(points, sharp) - limit_positions(points, smooth)
    assert limit_shift(points, sharp) == pytest.approx(np.linalg.norm(moved, axis=1).max())
    sharpness = np.where(np.arange(len(smooth.edges)) < 9, 0.5, 0)
    assert limit_shift(points, smooth.with_sharpness(sharpness)) > 0


@over_both
@given(data=st.data(), seed=seeds)
def test_limits_do_not_depend_on_threads(base, data, seed):
    mesh, blocks = data.draw(ANY[base.name]), Blocks(2, rows=5)
    topology = randomly_creased(mesh, seed)
    columns = np.random.default_rng(seed).standard_normal((len(mesh.vertices), 5))
    whole, parts = (limit_positions(columns, topology, b, base) for b in (None, blocks))
    np.testing.assert_array_equal(parts, whole)
    one, many = (limit_normals(mesh.vertices, topology, b, base) for b in (None, blocks))
    np.testing.assert_array_equal(many.vertices, one.vertices)
    np.testing.assert_array_equal(many.sectors, one.sectors)


@pytest.mark.parametrize("name", SHAPES)
def test_limits_of_quads_equal_opensubdivs(name):
    points, faces = SHAPES[name]
    points = uneven(points)
    limit = refine(Mesh(points, faces), catmull_clark(), 2)
    _, expected, along, across = opensubdiv.catmull_clark(points, faces, 2)
    corners, last = limit.mesh.faces, limit.mesh.topology()
    inside = np.ones(len(last.valence), dtype=bool)
    inside[last.edges[last.sharp_edges].reshape(-1)] = False
    # OpenSubdiv lets an inner vertex of valence 2 stay, which its own masks do not.
    known = (~inside | (last.valence > 2))[corners]
    ours = limit.mesh.vertices[corners]
    np.testing.assert_allclose(ours[known], expected[known], rtol=0, atol=1e-12)
    theirs = np.cross(along, across)
    theirs /= np.linalg.norm(theirs, axis=-1, keepdims=True)
    shown = known & inside[corners]
    np.testing.assert_allclose(limit.normals[corners][shown], theirs[shown], rtol=0, atol=1e-10)


# --- normals --------------------------------------------------------------------------------------


def test_on_a_sphere_normals_point_outwards_and_on_a_plane_along_its_normal():
    points, faces = icosphere(2)
    normals = limit_normals(points, creased(points, faces)).vertices
    assert np.sum(normals * points, axis=1).min() > np.cos(0.03)
    flat, faces = grid(5)
    normals = limit_normals(flat, creased(flat, faces)).vertices
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(flat), 1)), atol=1e-14)


def one_sided(points, topology, base):
    """The normal of the surface at each corner of its faces."""
    normals = limit_normals(points, topology, base=base)
    return normals.sectors[normals.sector_of_corner]


def assert_kept_by_a_step(points, topology, base, at=slice(None)):
    """Both tangents of each sector are left eigenvectors, or span what is one."""
    before = one_sided(points, topology, base)
    later = one_sided(*stepped(points, topology, base), base)
    # A corner's own child has it as its first corner.
    corner = np.arange(len(before))
    first = 4 * corner if base.polygons else 3 * (4 * (corner // 3) + corner % 3)
    again = later[first]
    # At corners the faces around say which way is out, and these change.
    sharp = np.bincount(
        topology.edges[topology.sharp_edges].reshape(-1), minlength=topology.vertex_count
    )
    turned = sharp[topology.corners] > 2
    again[turned] *= np.sign(np.sum(again * before, axis=1, keepdims=True))[turned]
    np.testing.assert_allclose(again[at], before[at], atol=1e-7)


@over_both
@given(data=st.data(), seed=seeds)
def test_a_step_leaves_normals_as_they_are(base, data, seed):
    mesh = data.draw(MANIFOLDS[base.name])
    assert_kept_by_a_step(mesh.vertices, randomly_creased(mesh, seed), base)


@over_both
@pytest.mark.parametrize("k", [3, 5, 8, 9, 10, 33, 200])
@pytest.mark.parametrize("kind", ["smooth", "dart", "curve"])
def test_normals_of_vertices_with_many_faces_stay_too(base, k, kind):
    points, faces = star(k) if base is LOOP else quad_star(k)
    plain = creased(points, faces)
    spokes = plain.edges[(plain.edges == 0).any(axis=1)]
    sharp = {"smooth": [], "dart": [0], "curve": [0, k // 2]}[kind]
    topology = creased(points, faces, spokes[sharp])
    there = topology.corners == 0
    assert_kept_by_a_step(uneven(points, k), topology, base, at=there)
    flat = one_sided(points, topology, base)[there]
    np.testing.assert_allclose(flat, np.tile([0, 0, 1.0], (k, 1)), atol=1e-9)


@pytest.mark.parametrize("name", ["cylinder", "mixed", "torus", "open box", "star of 7"])
def test_normals_of_quads_are_those_of_small_faces(name):
    points, faces = SHAPES[name]
    assert_those_of_small_faces(uneven(points, by=0.05), faces, CATMULL_CLARK)


@pytest.mark.parametrize("mesh", [bumpy_sphere(3), grid(5, bent), icosphere(0)])
def test_normals_of_triangles_are_those_of_small_faces(mesh):
    assert_those_of_small_faces(*mesh, LOOP)


def assert_those_of_small_faces(points, faces, base):
    topologies = level_topologies(faces, len(points), 6, base=base)
    small = base.faces(topologies[-1], Blocks(), np.int64)
    deep = refine_columns(points, topologies, base)[small]
    area = np.cross(deep[:, 1] - deep[:, 0], deep[:, -1] - deep[:, 0])
    area /= np.linalg.norm(area, axis=1, keepdims=True)
    normals = limit_normals(points, topologies[0], base=base).vertices
    smooth = topologies[0].sharp_count if len(topologies[0].sharp_count) else np.zeros(len(points))
    for v in np.flatnonzero(smooth == 0):
        around = area[(small == v).any(axis=1)]
        assert (around @ normals[v]).min() > np.cos(0.06)


def test_both_sides_of_a_crease_have_their_own_normal():
    """A roof: its ridge is a crease, and the slopes stay flat beside it."""
    points, faces = grid(5, lambda x, y: -np.abs(x))
    ridge = np.flatnonzero(points[:, 0] == 0)
    topology = creased(points, faces, np.stack([ridge[:-1], ridge[1:]], axis=1))
    sides = one_sided(points, topology, LOOP)[topology.corners == ridge[2]]
    slopes = np.unique(np.round(sides * np.sqrt(2), 9), axis=0)
    np.testing.assert_allclose(slopes, [[-1, 0, 1], [1, 0, 1]], atol=1e-9)
    middle = limit_normals(points, topology).vertices[ridge[2]]
    np.testing.assert_allclose(middle, [0, 0, 1], atol=1e-12)


def test_a_corner_wider_than_half_a_turn_looks_where_its_faces_do():
    """Three creases meet in a plane: sectors of 45, 45 and 270 degrees."""
    points, faces = star(8)
    normals = limit_normals(points, creased(points, faces, [[0, 1], [0, 2], [0, 3]]))
    assert len(np.unique(normals.sector_of_corner[::3])) == 3
    np.testing.assert_allclose(normals.sectors[:, 2], 1, atol=1e-12)


@pytest.mark.parametrize("crease", [[], [[3, 4]]])
def test_normals_that_cancel_are_zero(crease):
    """A sheet that is there from both sides has none."""
    rng = np.random.default_rng(0)
    points, faces = grid(5, lambda x, y: rng.uniform(-0.3, 0.3, x.shape))
    twice = np.concatenate([faces, faces[:, ::-1]])
    for turned in (points, points @ np.linalg.qr(rng.normal(size=(3, 3)))[0]):
        refined, after = stepped(turned, creased(turned, twice, crease), LOOP)
        assert not limit_normals(refined, after).vertices.any()


def test_a_fold_takes_no_part_in_the_normal_of_a_vertex_with_other_faces():
    """Two faces there and back, at a vertex of another: the normal there is the other one's."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, -1, 1], [0.9, -1, 2.0]])
    faces = np.array([[0, 1, 2], [0, 3, 4], [4, 3, 0]])
    normals = limit_normals(points, creased(points, faces)).vertices
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=1e-12)


def test_a_vertex_of_a_hundred_thousand_spokes_has_limit_and_normal():
    points, faces = star(100_000)
    points = uneven(points)
    for pairs in ([], [[0, 2]]):
        topology = creased(points, faces, pairs)
        assert np.isfinite(limit_positions(points, topology)).all()
        normal = limit_normals(points, topology).vertices[0]
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-12)


@over_both
@given(data=st.data())
def test_limits_of_any_faces_are_finite_and_each_normal_is_one_or_none(base, data):
    made = refine(data.draw(ANY[base.name]), loop() if base is LOOP else catmull_clark(), 1)
    assert np.isfinite(made.mesh.vertices).all()
    lengths = np.linalg.norm(made.normals, axis=1)
    np.testing.assert_allclose(lengths[lengths > 0.5], 1, atol=1e-12)
    assert ((lengths == 0) | (lengths > 0.5)).all()


@given(st.one_of(manifolds(), soups()))
def test_every_corner_is_in_one_sector_of_its_own_vertex(mesh):
    around = find_sectors(mesh.topology().connectivity)
    np.testing.assert_array_equal(around.vertex[around.of_corner], mesh.faces.reshape(-1))
    np.testing.assert_array_equal(np.bincount(around.of_corner), around.size)
