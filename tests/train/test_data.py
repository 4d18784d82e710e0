"""Surfaces, pairs, simplified shapes and files: what training and validation are made of."""

from functools import cache
from itertools import islice

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

from pns_common import Mesh, MeshError
from pns_common.mesh.normals import measure_faces
from pns_common.mesh.reference_length import measure_reference_length
from pns_common.parallel import Blocks
from tests.support.meshes import bumpy_sphere
from tests.support.meshes import icosphere as small_sphere
from tests.support.shared import published
from train.connectivity import connect
from train.data.batch import disjoint_union
from train.data.datasets import DATASETS, ridge_training
from train.data.dense_meshes import is_manifold, largest_part, read_mesh
from train.data.icosphere import icosphere
from train.data.pairs.faceted import faceted_pair
from train.data.pairs.grid import grid_pair
from train.data.pairs.lathe import (
    PLANS,
    centred,
    ears,
    lathe_pair,
    polygon,
    raised,
    random_lid,
)
from train.data.pairs.machined import machined_pairs
from train.data.pairs.pair_stream import pair_stream
from train.data.pairs.polygons import in_polygons, polygon_stream
from train.data.pairs.polygons import is_manifold as is_manifold_of_polygons
from train.data.pairs.references import patch_pair, sphere_pair
from train.data.pairs.solid import solid_pairs
from train.data.sharp_labels import coarse_sharp_edges, sharp_edges
from train.data.simplifiers import SIMPLIFIERS
from train.data.validation import coarse_mesh, read_shape, validation_meshes
from train.surfaces.brep import box, chamfered, cut, cylinder, edge_groups, filleted, tessellated
from train.surfaces.implicit import Ridge, Saddle, SphereRidge, signed_distance, unit_normal
from train.surfaces.smooth import Bump, CurvedRidge, Fillet, LumpySphere
from train.vectors import face_normals

# --- surfaces -------------------------------------------------------------------------------------

SURFACES = [
    Ridge(amplitude=0.6, sharpness=7.0, angle=0.7, centre_x=0.05, centre_y=-0.02),
    Saddle(amplitude=0.5, centre_x=0.05, centre_y=-0.02),
    SphereRidge(radius=1.0, amplitude=0.1, sharpness=30.0, angle=2.9),
    CurvedRidge(amplitude=0.5, sharpness=6.0, radius=0.9, centre_x=-0.3, centre_y=0.1),
    Bump(amplitude=0.5, sharpness=4.0, elongation=0.3, angle=0.8, centre_x=0.4, centre_y=0.3),
    LumpySphere(0.8, amplitude=0.1, frequency=4.0, phases=(0.3, 1.1, 2.0)),
    Fillet(1.0),
]


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_gradients_are_derivatives_and_distances_right_to_first_order(surface):
    points = np.random.default_rng(0).uniform(0.2, 0.9, size=(50, 3))
    steps = 1e-6 * np.eye(3)
    slopes = [(surface.value(points + e) - surface.value(points - e)) / 2e-6 for e in steps]
    np.testing.assert_allclose(surface.gradient(points), np.stack(slopes, axis=1), atol=1e-8)
    # Newton steps along the gradient reach the surface; then step off it by a known length.
    for _ in range(50):
        gradient = surface.gradient(points)
        points = points - (surface.value(points) / (gradient**2).sum(-1))[:, None] * gradient
    np.testing.assert_allclose(surface.value(points), 0, atol=1e-12)
    away = points + 1e-5 * unit_normal(surface, points)
    np.testing.assert_allclose(signed_distance(surface, away), 1e-5, rtol=2e-3)


def volume(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume


def test_a_drilled_box_has_its_volume_and_exact_normals():
    block = box((-1, -1, -1), (1, 1, 1))
    drilled = tessellated(cut(block, [cylinder((0, 0), 0.5, -2, 2)]), 1e-3, 0.1)
    assert volume(Mesh(drilled.vertices, drilled.faces)) == pytest.approx(8 - np.pi / 2, rel=2e-3)
    corners = drilled.vertices[drilled.faces]
    across = face_normals(drilled.vertices, drilled.faces)
    assert (across[:, None] * drilled.normals).sum(axis=2).min() > 0.99
    bore = np.hypot(*corners[..., :2].reshape(-1, 2).T) < 0.5 + 1e-6
    inward = -corners[..., :2].reshape(-1, 2)[bore] / 0.5
    normals = drilled.normals.reshape(-1, 3)[bore]
    side = np.abs(normals[:, 2]) < 0.5
    np.testing.assert_allclose(normals[side, :2], inward[side], atol=1e-6)


@pytest.mark.parametrize(
    ("finish", "taken"), [(chamfered, 2 * 0.2**2), (filleted, (4 - np.pi) * 0.2**2)]
)
def test_finished_edges_take_what_they_should(finish, taken):
    solid = box((-1, -1, -1), (1, 1, 1))
    upright = next(group for group in edge_groups(solid) if len(group) == 4)
    made = tessellated(finish(solid, upright, 0.2), 1e-3, 0.1)
    assert volume(Mesh(made.vertices, made.faces)) == pytest.approx(8 - 2 * taken, rel=1e-4)


# --- the paper's sets -----------------------------------------------------------------------------


def test_each_inserted_vertex_belongs_to_its_own_instance():
    instances = ridge_training().instances[:3]
    batch = disjoint_union(instances)
    level = batch.mesh
    midpoints = batch.points.numpy()[level.edges[level.interior]].mean(axis=1)
    values = batch.surface.value(torch.from_numpy(midpoints)).numpy()
    expected = [
        instance.surface.value(part)
        for instance, part in zip(instances, np.split(midpoints, 3), strict=True)
    ]
    np.testing.assert_allclose(values, np.concatenate(expected), rtol=0, atol=1e-15)


PUBLISHED_NAMES = {
    "ridge-training": "ridge_train",
    "ridge-held-out": "ridge_test",
    "saddle-training": "saddle_train",
    "saddle-held-out": "saddle_test",
    "sphere-ridge-held-out": "sphere_test",
}


@pytest.mark.parametrize("name", DATASETS)
def test_instances_are_the_published_ones_to_float32(name):
    data, key = published("datasets.npz"), PUBLISHED_NAMES[name]
    instances = DATASETS[name]().instances
    vertices = np.stack([instance.mesh.vertices for instance in instances])
    np.testing.assert_allclose(vertices, data[f"{key}_vertices"], rtol=0, atol=1.2e-7)
    for instance in instances:
        np.testing.assert_array_equal(instance.mesh.faces, data[f"{key}_faces"])


# --- pairs ----------------------------------------------------------------------------------------

SEVERAL, OPEN = [solid_pairs, machined_pairs], [grid_pair, patch_pair]
KINDS = [*SEVERAL, *OPEN, sphere_pair, faceted_pair, lathe_pair]


@pytest.mark.parametrize("kind", KINDS)
def test_coarse_faces_look_the_way_the_surface_does_and_solids_are_closed(kind):
    rng, pairs = np.random.default_rng(3), []
    while len(pairs) < 3:
        made = list(kind(rng)) if kind in SEVERAL else [kind(rng)]
        pairs += [pair for pair in made if pair is not None]
    for pair in pairs[:3]:
        normals = face_normals(pair.coarse.vertices, pair.coarse.faces)
        middle = pair.coarse.vertices[pair.coarse.faces].mean(axis=1)
        distance, nearest = cKDTree(pair.surface.points).query(middle)
        agreement = (normals * pair.surface.normals[nearest]).sum(axis=1)
        assert np.median(agreement) > 0.9
        assert np.median(distance) < 0.2 * np.ptp(pair.coarse.vertices)
        np.testing.assert_allclose(np.linalg.norm(pair.surface.normals, axis=1), 1, atol=1e-6)
        closed = connect(pair.coarse.faces, len(pair.coarse.vertices)).paired.all()
        assert closed or kind in OPEN


def area(plan, triangles):
    """Of each triangle, negative where it is clockwise."""
    a, b, c = (np.append(plan, [[0.0, 0.0]], axis=0)[triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return (ux * vy - uy * vx) / 2


@pytest.mark.parametrize("draw", PLANS)
def test_a_plan_is_anticlockwise_and_every_lid_covers_it_once(draw):
    rng = np.random.default_rng(1)
    for _ in range(20):
        for plan in draw(rng):
            x, y = plan.T
            whole = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
            assert whole > 0
            triangles = area(plan, random_lid(plan, rng))
            assert triangles.min() > -1e-12
            assert triangles.sum() == pytest.approx(whole)


@cache
def begun(stream, seed):
    return list(islice(stream(seed), 6))


@pytest.mark.parametrize("stream", [pair_stream, polygon_stream])
def test_a_stream_depends_on_its_seed_alone(stream):
    for a, b in zip(begun(stream, 0), islice(stream(0), 6), strict=True):
        assert a.kind == b.kind
        np.testing.assert_array_equal(a.coarse.vertices, b.coarse.vertices)
        np.testing.assert_array_equal(a.coarse.corners, b.coarse.corners)
        np.testing.assert_array_equal(a.surface.points, b.surface.points)
    sizes = [[pair.coarse.face_count for pair in islice(stream(s), 2)] for s in (0, 1)]
    assert sizes[0] != sizes[1]


def test_polygons_are_mostly_quads_and_lie_on_their_surface_the_way_it_looks():
    pairs = begun(polygon_stream, 0)
    degrees = np.concatenate([np.diff(pair.coarse.offsets) for pair in pairs])
    assert (degrees == 4).mean() > 0.6
    for pair in pairs:
        mesh = pair.coarse
        assert measure_reference_length(mesh.vertices, mesh.corners) == pytest.approx(1)
        normals, _ = measure_faces(mesh.vertices, mesh.topology(), Blocks(), areas=False)
        middle = np.array([mesh.vertices[face].mean(axis=0) for face in mesh.polygons])
        _, nearest = cKDTree(pair.surface.points).query(middle)
        assert np.median((normals * pair.surface.normals[nearest]).sum(axis=1)) > 0.9


def test_triangles_of_a_drum_are_joined_to_its_quads_and_lids():
    plan = polygon(12)
    drum = raised(np.array([[1.0, 0], [1, 2]]), plan, (ears(plan), ears(plan)))
    lids = set()
    for seed in range(8):
        made = in_polygons(drum, np.random.default_rng(seed))
        assert volume(made.triangulated()) == pytest.approx(volume(drum))
        assert is_manifold_of_polygons(made)
        walls = [face for face in made.polygons if np.ptp(made.vertices[face, 2]) > 1]
        assert [len(face) for face in walls] == [4] * 12
        lids.add(int((np.diff(made.offsets) == 12).sum()))
    assert lids == {0, 2}


# --- simplified shapes and their sharp edges ------------------------------------------------------


@pytest.mark.parametrize("name", SIMPLIFIERS)
def test_simplifiers_come_near_the_target_stay_on_the_sphere_and_give_the_same_again(name):
    sphere = icosphere(4)
    for faces in (100, 500):
        coarse, again = (SIMPLIFIERS[name](sphere, faces) for _ in range(2))
        assert faces / 1.6 <= len(coarse.faces) <= 1.6 * faces
        assert np.abs(np.linalg.norm(coarse.vertices, axis=1) - 1).max() < 0.15
        np.testing.assert_array_equal(coarse.vertices, again.vertices)
        np.testing.assert_array_equal(coarse.faces, again.faces)


@pytest.mark.parametrize(
    ("outline", "sharp_heights"),
    [
        ([[1.0, -1], [1, 1]], {-1.0, 1.0}),
        # Bands beside a rim: the rim alone, though the bands' edges are as near as the reach.
        ([[1.0, 0], [1, 1], [1, 1.05], [1, 1.1], [0, 1.1]], {0.0, 1.1}),
    ],
)
def test_the_rims_of_a_drum_are_sharp_and_nothing_else_is(outline, sharp_heights):
    def turned(sides):
        return raised(np.array(outline), polygon(sides), (centred(sides),) * 2)

    coarse, fine = turned(16), turned(176)
    labels = coarse_sharp_edges(coarse, sharp_edges(fine, np.radians(15)))
    ends = coarse.vertices[coarse.topology().edges.astype(int)]
    on_rim = (np.hypot(ends[..., 0], ends[..., 1]) > 0.9).all(axis=1)
    rim = on_rim & (ends[:, 0, 2] == ends[:, 1, 2]) & np.isin(ends[:, 0, 2], list(sharp_heights))
    np.testing.assert_array_equal(labels, rim)


# --- files ----------------------------------------------------------------------------------------

SPHERE = bumpy_sphere(subdivisions=3)  # 1280 faces


def write(path, *shapes):
    """Write meshes as parts of one file."""
    scene = trimesh.Scene([trimesh.Trimesh(*shape, process=False) for shape in shapes])
    scene.export(path)
    return path


def test_a_file_is_welded_by_position_and_its_largest_part_is_taken(tmp_path):
    vertices, faces = SPHERE
    torn = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    mesh = read_mesh(write(tmp_path / "torn.ply", torn))
    assert len(mesh.vertices) == len(vertices)
    assert is_manifold(mesh)
    small, corners = small_sphere(1)
    part = largest_part(
        read_mesh(write(tmp_path / "two.glb", (np.add(small, [5, 0, 0]), corners), SPHERE))
    )
    assert len(part.faces) == len(faces)
    assert np.abs(part.vertices).max() < 2


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("mesh.npz", b""),
        ("mesh.npz", b"PK\3\4"),
        ("mesh.npz", b"no arrays"),
        ("mesh.obj", b"glTF, but no more"),
        ("mesh.obj", b"v 0 0 0\n"),
    ],
)
def test_a_file_without_triangles_is_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError):
        read_mesh(tmp_path / name)


def test_meshes_of_ones_own_validate(tmp_path):
    """`dense.csv` lists them; parts have the sharp edges that turn enough."""
    write(tmp_path / "ball.ply", SPHERE)
    cube = trimesh.creation.box().subdivide().subdivide().subdivide().subdivide()
    write(tmp_path / "box.obj", (cube.vertices, cube.faces))
    listed = "file,kind\nball.ply,scan\nbox.obj,part\nabsent.stl,part\n"
    (tmp_path / "dense.csv").write_text(listed)
    drawn = validation_meshes(tmp_path)
    assert {each.path.name for each in drawn} == {"ball.ply", "box.obj"}
    shapes = {each.path.name: read_shape(each.path, each.kind) for each in drawn}
    assert shapes["ball.ply"].sharp is None
    ends = shapes["box.obj"].sharp
    assert np.isclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum(), 12)
    coarse = coarse_mesh(shapes["ball.ply"], drawn[0])
    assert coarse is not None
    assert len(coarse.faces) <= 640
