"""The construction's promises over Catmull–Clark, for any weights, on any polygons."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, catmull_clark, pns
from pns_common.carry.columns import level_topologies
from pns_common.mesh.topology import EdgeClass
from pns_common.operator.formula import edge_inputs, face_inputs, pushes, vertex_inputs
from pns_common.refinement import control_level
from pns_common.schemes import CATMULL_CLARK
from pns_common.schemes.limit import limit_positions
from tests.support.control_points import refine
from tests.support.meshes import bent, manifolds, rotation
from tests.support.networks import DEFAULT_CARD, TiedPolygonModel, polygon_model
from tests.support.polygons import (
    CUBE_FACES,
    SHAPES,
    correspondence,
    envelope,
    polygon_manifolds,
    polygon_soups,
    quad_grid,
    quad_star,
    rows_of,
    uneven,
)

MODELS = [polygon_model(seed, scale) for seed, scale in ((0, 1.0), (1, 3.0), (2, 300.0))]
models = st.sampled_from(MODELS)
ROUNDING = 1 + 1e-12
CARD = polygon_model().card


TIED = TiedPolygonModel(3)
refined_once = partial(refine, levels=1, creases=None)


@given(st.one_of(polygon_manifolds(), polygon_soups(), manifolds()), models, st.floats(1e-2, 1e2))
def test_displacement_within_budget(mesh, model, budget):
    """‖x − x0‖ ≤ C h² / R at vertices, edges and faces, from the output positions."""
    refined = refined_once(mesh, pns(model, budget))
    base = refined_once(mesh, catmull_clark()).mesh.vertices
    length = refined.report["reference_length"]
    if not length:
        np.testing.assert_array_equal(refined.mesh.vertices, base)
        return
    bound = envelope(mesh, budget, length)
    topology = mesh.topology()
    ends = topology.edges[topology.edge_class == EdgeClass.BOUNDARY].reshape(-1)
    size = np.abs(mesh.vertices).max()
    apart = np.linalg.norm(refined.mesh.vertices - base, axis=1)
    inside = np.ones(len(apart), dtype=bool)
    inside[ends] = False  # on a boundary h² is the mean over both spokes of the curve alone
    assert (apart <= ROUNDING * bound + 1e-14 * size)[inside].all()
    assert refined.ratio.max() <= ROUNDING


@given(st.one_of(polygon_manifolds(), polygon_soups()), models)
def test_no_child_folds(mesh, model):
    """The triangle at each corner of each quad stays within 75 degrees of Catmull–Clark's."""
    ours = refined_once(mesh, pns(model)).mesh
    base = refined_once(mesh, catmull_clark()).mesh
    for corner in range(4):
        areas = []
        for points in (ours.vertices, base.vertices):
            p, q, r = (points[base.faces[:, (corner + k) % 4]] for k in range(3))
            areas.append(np.cross(q - p, r - p))
        new, old = areas
        sizes = np.linalg.norm(new, axis=1) * np.linalg.norm(old, axis=1)
        shown = np.linalg.norm(old, axis=1) > 1e-9 * np.abs(mesh.vertices).max() ** 2
        cosine = np.einsum("ij,ij->i", new, old)[shown] / np.maximum(sizes[shown], 1e-300)
        assert (cosine >= np.cos(np.radians(75)) - 1e-6).all()


@given(polygon_manifolds(), st.integers(0, 2**31))
def test_commutes_with_rigid_motion(mesh, seed):
    rng = np.random.default_rng(seed)
    turn, shift = rotation(rng), rng.standard_normal(3)
    still = refined_once(mesh, pns(TIED)).mesh.vertices
    moved = refined_once(Mesh(mesh.vertices @ turn.T + shift, rows_of(mesh)), pns(TIED))
    np.testing.assert_allclose(moved.mesh.vertices, still @ turn.T + shift, rtol=0, atol=1e-11)


@given(polygon_manifolds(), st.integers(-20, 20))
def test_scaling_a_mesh_scales_the_result(mesh, power):
    scale, scheme = 2.0**power, pns(TIED)
    small = refine(mesh, scheme, 2).mesh.vertices
    large = refine(Mesh(scale * mesh.vertices, rows_of(mesh)), scheme, 2).mesh.vertices
    np.testing.assert_allclose(large / scale, small, rtol=0, atol=1e-12)


@given(polygon_manifolds(), st.integers(0, 2**31))
def test_renumbering_permutes_the_output(mesh, seed):
    """Other numbers, another order of faces, and another first corner of each."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    points = np.empty_like(mesh.vertices)
    points[order] = mesh.vertices
    faces = [np.roll(order[face], rng.integers(9)).tolist() for face in rows_of(mesh)]
    other = Mesh(points, [faces[f] for f in rng.permutation(len(faces))])
    where = correspondence(mesh, other, order)
    ours, theirs = (refined_once(each, pns(TIED)).mesh.vertices for each in (mesh, other))
    np.testing.assert_allclose(theirs[where], ours, rtol=0, atol=1e-11)


@given(polygon_manifolds(), st.booleans())
def test_mirrored_and_turned_over_meshes_give_mirrored_and_equal_points(mesh, mirrored):
    """A mirrored mesh has its faces turned; a mesh turned over keeps its positions."""
    flip = np.array([-1.0, 1, 1]) if mirrored else np.ones(3)
    other = Mesh(mesh.vertices * flip, [face[::-1] for face in rows_of(mesh)])
    where = correspondence(mesh, other, np.arange(len(mesh.vertices)))
    ours, theirs = (refined_once(each, pns(TIED)).mesh.vertices for each in (mesh, other))
    np.testing.assert_allclose(theirs[where] * flip, ours, rtol=0, atol=1e-11)


@pytest.mark.parametrize("model", MODELS)
def test_planes_give_catmull_clark(model):
    rng = np.random.default_rng(0)
    for points, faces in (quad_grid(6), quad_star(5), SHAPES["pentagon"]):
        flat = points * [1, 1, 0] + 0.05 * rng.standard_normal((len(points), 3)) * [1, 1, 0]
        mesh = Mesh(flat, faces)
        ours, base = (
            refine(mesh, scheme, 2).mesh.vertices for scheme in (pns(model, 1.0), "catmull-clark")
        )
        ends = mesh.topology().edges[mesh.topology().sharp_edges]
        inside = np.ones(len(ours), dtype=bool)
        if len(ends):
            # A boundary is a curve of its own, which bends in its plane.
            near = control_level(mesh, pns(model), 1.0).topology.sharp_count > 0
            inside = ~reached(mesh, near)
        np.testing.assert_array_equal(ours[inside], base[inside])


def reached(mesh, rim):
    """New vertices after two levels that a vertex on the rim reaches."""
    from pns_common.carry.columns import refine_columns

    topologies = level_topologies(mesh.polygons, len(mesh.vertices), 2, base=CATMULL_CLARK)
    return refine_columns(rim[:, None].astype(float), topologies, CATMULL_CLARK)[:, 0] > 0


def test_a_plane_in_any_orientation_opens_no_gate():
    points, faces = quad_grid(6)
    rng = np.random.default_rng(1)
    points[:, :2] += 0.05 * rng.standard_normal((len(points), 2))
    mesh = Mesh(points @ rotation(rng).T, faces)
    level, rule = control_level(mesh, pns(MODELS[0]), 1.0), pns(MODELS[0]).rule
    vertices = np.flatnonzero(level.ringed)
    for at in (
        edge_inputs(level, rule, level.topology.interior),
        vertex_inputs(level, rule, vertices),
        face_inputs(level, rule, np.arange(mesh.face_count)),
    ):
        assert at.gate.max() < 1e-25
    assert np.abs(pushes(level, rule)).max() < 1e-14


@given(polygon_manifolds(), models)
def test_the_limit_surface_is_within_the_reported_distance(mesh, model):
    ours = refine(mesh, pns(model), 3, limit=True, creases=None)
    base = refine(mesh, catmull_clark(), 3, limit=True, creases=None)
    apart = np.linalg.norm(ours.mesh.vertices - base.mesh.vertices, axis=1).max()
    report = ours.report
    assert apart <= report["limit_distance"] * ROUNDING + 1e-13
    assert report["limit_distance"] <= report["limit_distance_bound"] * ROUNDING
    assert report["learned_levels"] == 1


@pytest.mark.parametrize("name", SHAPES)
def test_a_budget_of_zero_is_catmull_clark_bit_for_bit(name):
    points, faces = SHAPES[name]
    mesh = Mesh(uneven(points), faces)
    ours, base = (
        refine(mesh, scheme, 2).mesh.vertices for scheme in (pns(MODELS[1], 0.0), catmull_clark())
    )
    np.testing.assert_array_equal(ours, base)


@given(st.one_of(polygon_soups(), polygon_manifolds()), models)
def test_any_polygons_are_refined_and_reported(mesh, model):
    refined = refine(mesh, pns(model), 2)
    assert np.isfinite(refined.mesh.vertices).all()
    first = refined.report["levels"][0]
    if refined.report["reference_length"]:
        assert first["face_rule"]["vertices"] == mesh.face_count
        assert first["face_rule"]["proximity_ratio"]["max"] <= ROUNDING
        assert first["vertex_rule"]["proximity_ratio"]["max"] <= ROUNDING


@given(polygon_manifolds())
def test_the_prior_pushes_back_what_the_limit_takes(mesh):
    """d = s ((p − L p) · m) m, from the limit mask and normals of faces' area vectors."""
    level, rule = control_level(mesh, pns(MODELS[0]), creases=None), pns(MODELS[0]).rule
    points, total, sizes = (
        mesh.vertices,
        np.zeros(mesh.vertices.shape),
        np.zeros(len(mesh.vertices)),
    )
    for face in rows_of(mesh):
        corners = points[face]
        area = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        for v in face:
            total[v] += area
            sizes[v] += np.linalg.norm(area)
    mean = total / np.maximum(sizes, 1e-300)[:, None]
    unit = mean / np.maximum(np.linalg.norm(mean, axis=1), 1 / 4)[:, None]
    lost = points - limit_positions(points, level.topology, base=CATMULL_CLARK)
    expected = np.einsum("ij,ij->i", lost, unit)[:, None] * unit
    expected[~level.ringed] = 0
    np.testing.assert_allclose(pushes(level, rule), expected, rtol=0, atol=1e-12)


def test_features_of_a_sphere_of_quads_are_what_they_are_called():
    """On a sphere x, the signed bends and the umbrellas have one sign, and nothing is uneven."""
    mesh = Mesh(2 * SHAPES["cube"][0] - 1, CUBE_FACES)
    for _ in range(2):
        finer = refine(mesh, catmull_clark(), 1).mesh
        mesh = Mesh(finer.vertices / np.linalg.norm(finer.vertices, axis=1)[:, None], finer.faces)
    level, rule = control_level(mesh, pns(MODELS[0]), creases=None), pns(MODELS[0]).rule
    at = face_inputs(level, rule, np.arange(mesh.face_count))
    jump, bend, middle, spread, umbrella, range_, unevenness, ratio = at.features.T
    assert (jump > 0).all()
    assert (bend > 0).all()
    assert (middle > 0).all()
    assert (umbrella < 0).all()
    assert unevenness.max() < 1e-3
    assert ((ratio > 0.5) & (ratio <= 1)).all()
    assert (spread >= 0).all()
    assert (range_ >= 0).all()
    outwards = mesh.vertices[mesh.faces].mean(axis=1)
    normal = at.basis[:, :3]
    cosine = np.einsum("ij,ij->i", normal, outwards) / np.linalg.norm(outwards, axis=1)
    assert cosine.min() > 0.99


def test_the_untrained_prior_halves_the_error_on_a_sphere():
    mesh = Mesh(2 * SHAPES["cube"][0] - 1, CUBE_FACES)
    for _ in range(2):
        finer = refine(mesh, catmull_clark(), 1).mesh
        mesh = Mesh(finer.vertices / np.linalg.norm(finer.vertices, axis=1)[:, None], finer.faces)
    prior, base = (
        np.abs(np.linalg.norm(refine(mesh, scheme, 2).mesh.vertices, axis=1) - 1).max()
        for scheme in (pns(polygon_model(scale=0.0)), catmull_clark())
    )
    assert prior < base / 2


def test_named_creases_stay_and_are_as_sharp_as_in_the_base_scheme():
    points, faces = quad_grid(6, bent)
    creases = Creases(np.array([[14, 15], [15, 16]]))
    ours = refine(Mesh(points, faces), pns(MODELS[0]), 3, creases=creases)
    assert ours.report["levels"][-1]["edges"]["crease"] == 8


def test_a_model_without_a_face_network_is_refused_over_catmull_clark():
    broken = DEFAULT_CARD.to_json().replace('"loop"', '"catmull-clark"')
    with pytest.raises(ValueError, match="face_features"):
        type(DEFAULT_CARD).from_json(broken)
    over_loop = CARD.to_json().replace('"catmull-clark"', '"loop"')
    with pytest.raises(ValueError, match="face_features"):
        type(DEFAULT_CARD).from_json(over_loop)
