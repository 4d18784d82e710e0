"""Promises of models of directed edges for any weights, over Loop and Catmull–Clark."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, ModelError, catmull_clark, loop, pns
from pns_common.mesh.topology import EdgeClass
from tests.support.control_points import refine
from tests.support.directed import NUMBERS, directed_model, directed_model_bytes
from tests.support.meshes import bent, grid, manifolds, rotation, soups
from tests.support.polygons import (
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
from train.certificates.double_precision import double_model
from train.certificates.learned_once import largest_turn

BASES = {"loop": loop(), "catmull-clark": catmull_clark()}
MODELS = {
    base: [directed_model(seed, scale, base) for seed, scale in ((0, 0.3), (1, 3.0), (2, 300.0))]
    for base in BASES
}
EXACT = {
    base: double_model(directed_model(3, 0.3, base), directed_model_bytes(3, 0.3, base))
    for base in BASES
}
MANIFOLDS = {"loop": manifolds(), "catmull-clark": st.one_of(polygon_manifolds(), manifolds())}
ANY = {
    "loop": st.one_of(soups(), manifolds()),
    "catmull-clark": st.one_of(polygon_soups(), polygon_manifolds(), manifolds()),
}
ROUNDING = 1 + 1e-12
QUAD = np.array([[0, 1, 3], [1, 2, 0], [2, 3, 1], [3, 0, 2]])

over_both = pytest.mark.parametrize("base", BASES)


def once(mesh, scheme, **options):
    return refine(mesh, scheme, 1, **options)


def corner_triangles(faces):
    """Triangles themselves, or the triangle at each corner of quads."""
    return faces if faces.shape[1] == 3 else faces[:, QUAD].reshape(-1, 3)


@over_both
@given(data=st.data(), number=st.integers(0, 2), budget=st.floats(1e-2, 1e2))
def test_displacement_within_budget(base, data, number, budget):
    """‖x − x0‖ ≤ C h² / R at every new vertex, from the output positions."""
    mesh, model = data.draw(ANY[base]), MODELS[base][number]
    refined = once(mesh, pns(model, budget), creases=None)
    plain, length = once(mesh, BASES[base]).mesh.vertices, refined.report["reference_length"]
    if not length:
        np.testing.assert_array_equal(refined.mesh.vertices, plain)
        return
    bound, topology = envelope(mesh, budget, length)[: len(plain)], mesh.topology()
    apart = np.linalg.norm(refined.mesh.vertices - plain, axis=1)
    inside = np.ones(len(apart), dtype=bool)
    # On a boundary h² is the mean over both spokes of the curve alone.
    inside[topology.edges[topology.edge_class == EdgeClass.BOUNDARY].reshape(-1)] = False
    size = np.abs(mesh.vertices).max()
    assert (apart <= ROUNDING * bound + 1e-14 * size)[inside].all()
    assert refined.ratio.max() <= ROUNDING


@over_both
@given(data=st.data(), number=st.integers(0, 2), learned=st.booleans())
def test_no_child_folds(base, data, number, learned):
    """Children stay within the card's angle of the base's, whose creases are the same."""
    mesh, scheme = data.draw(ANY[base]), pns(MODELS[base][number])
    ours = once(mesh, scheme, creases="auto" if learned else None)
    step = ours.steps[0]
    plain = step.level.base.place(step.level.points, step.level.topology, step.level.blocks)
    triangles = corner_triangles(ours.mesh.faces)
    assert largest_turn(triangles, plain, ours.mesh.vertices) <= NUMBERS["fold_angle"] + 1e-4


@over_both
@given(data=st.data(), seed=st.integers(0, 2**31))
def test_commutes_with_rigid_motion(base, data, seed):
    mesh, scheme, rng = data.draw(MANIFOLDS[base]), pns(EXACT[base]), np.random.default_rng(seed)
    turn, shift = rotation(rng), rng.standard_normal(3)
    still = once(mesh, scheme).mesh.vertices
    moved = once(Mesh(mesh.vertices @ turn.T + shift, rows_of(mesh)), scheme).mesh.vertices
    np.testing.assert_allclose(moved, still @ turn.T + shift, rtol=0, atol=1e-10)


@over_both
@given(data=st.data(), power=st.integers(-20, 20))
def test_scaling_a_mesh_scales_the_result(base, data, power):
    mesh, scheme, scale = data.draw(MANIFOLDS[base]), pns(EXACT[base]), 2.0**power
    small = refine(mesh, scheme, 2).mesh.vertices
    large = refine(Mesh(scale * mesh.vertices, rows_of(mesh)), scheme, 2).mesh.vertices
    np.testing.assert_allclose(large / scale, small, rtol=0, atol=1e-12)


@over_both
@given(data=st.data(), seed=st.integers(0, 2**31))
def test_renumbering_permutes_the_output(base, data, seed):
    """Other numbers, another order of faces, and another first corner of each."""
    mesh, scheme, rng = data.draw(MANIFOLDS[base]), pns(EXACT[base]), np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    points = np.empty_like(mesh.vertices)
    points[order] = mesh.vertices
    faces = [np.roll(order[face], rng.integers(9)).tolist() for face in rows_of(mesh)]
    other = Mesh(points, [faces[f] for f in rng.permutation(len(faces))])
    ours, theirs = (once(each, scheme).mesh.vertices for each in (mesh, other))
    where = correspondence(mesh, other, order)[: len(ours)]
    np.testing.assert_allclose(theirs[where], ours, rtol=0, atol=1e-10)


@over_both
@given(data=st.data())
def test_a_mirrored_mesh_gives_the_mirrored_result(base, data):
    """Of weights so small that the vertices of faces are asked for less than a whole edge."""
    mesh, scheme, flip = data.draw(MANIFOLDS[base]), pns(EXACT[base]), np.array([-1.0, 1, 1])
    other = Mesh(mesh.vertices * flip, [face[::-1] for face in rows_of(mesh)])
    ours, theirs = (once(each, scheme).mesh.vertices for each in (mesh, other))
    where = correspondence(mesh, other, np.arange(len(mesh.vertices)))[: len(ours)]
    np.testing.assert_allclose(theirs[where] * flip, ours, rtol=0, atol=1e-10)


@over_both
@pytest.mark.parametrize("number", range(3))
def test_planes_give_the_base_scheme(base, number):
    """But for borders, which are curves of their own: exactly across the axes, δ = 0 anyhow."""
    rng = np.random.default_rng(0)
    shapes = [grid(7)] if base == "loop" else [quad_grid(7), quad_star(5, 3), SHAPES["pentagon"]]
    for points, faces in shapes:
        points = points + 0.03 * rng.standard_normal(points.shape)
        points[:, 2] = 0.7
        for turn in (np.eye(3), rotation(rng)):
            mesh = Mesh(points @ turn.T, faces)
            scheme = pns(MODELS[base][number])
            ours, plain = (once(mesh, rules).mesh.vertices for rules in (scheme, BASES[base]))
            inside = np.ones(len(ours), dtype=bool)
            topology = mesh.topology()
            inside[topology.edges[topology.sharp_edges].reshape(-1)] = False
            inside[len(points) + topology.sharp_edges.astype(np.int64)] = False
            if turn[0, 0] == 1:
                np.testing.assert_array_equal(ours[inside], plain[inside])
            np.testing.assert_allclose(ours[inside], plain[inside], rtol=0, atol=1e-15)


@over_both
@given(data=st.data(), number=st.integers(0, 2))
def test_the_limit_surface_is_within_the_reported_distance(base, data, number):
    mesh, scheme = data.draw(MANIFOLDS[base]), pns(MODELS[base][number])
    ours, plain = (
        refine(mesh, rules, 3, limit=True, creases=None) for rules in (scheme, BASES[base])
    )
    apart = np.linalg.norm(ours.mesh.vertices - plain.mesh.vertices, axis=1).max()
    assert apart <= ours.report["limit_distance"] * ROUNDING + 1e-13
    assert ours.report["limit_distance"] <= ours.report["limit_distance_bound"] * ROUNDING
    assert ours.report["learned_levels"] == 1


@over_both
@given(data=st.data(), number=st.integers(0, 2))
def test_any_mesh_is_refined_and_reported(base, data, number):
    refined = refine(data.draw(ANY[base]), pns(MODELS[base][number]), 2)
    assert np.isfinite(refined.mesh.vertices).all()
    first = refined.report["levels"][0]
    assert first["proximity_ratio"]["max"] <= ROUNDING


@over_both
def test_a_budget_of_zero_is_the_base_scheme_bit_for_bit(base):
    points, faces = grid(5, bent) if base == "loop" else SHAPES["cylinder"]
    mesh, model = Mesh(uneven(points), faces), MODELS[base][1]
    ours, plain = (refine(mesh, rules, 2).mesh.vertices for rules in (pns(model, 0.0), BASES[base]))
    np.testing.assert_array_equal(ours, plain)


@over_both
@pytest.mark.parametrize("creases", ["auto", None])
def test_an_answer_that_is_no_number_is_an_error(base, creases):
    points, faces = grid(5, bent) if base == "loop" else quad_grid(5, bent)
    with pytest.raises(ModelError, match="finite"):
        once(Mesh(points, faces), pns(directed_model(0, 1e25, base)), creases=creases)


@over_both
def test_the_number_of_threads_changes_no_bit(base):
    points, faces = grid(60, bent) if base == "loop" else quad_grid(60, bent)
    mesh, scheme = Mesh(uneven(points, by=0.005), faces), pns(MODELS[base][0])
    one, several = (refine(mesh, scheme, 2, threads=count).mesh.vertices for count in (1, 4))
    np.testing.assert_array_equal(one, several)


@over_both
@pytest.mark.parametrize("number", range(3))
def test_tiles_that_share_a_border_meet(base, number):
    """Nothing that is learned inside moves a border."""
    points, faces = grid(7, bent) if base == "loop" else quad_grid(7, bent)
    points[:, 0] += 0.05 * np.sin(5 * points[:, 1]) * (np.abs(points[:, 1]) < 0.9)
    centre = points[faces].mean(axis=1)[:, 0]
    halves = [faces[centre < 0], faces[centre > 0]]
    assert sum(map(len, halves)) == len(faces)
    made = []
    for half in halves:
        used = np.unique(half)
        mesh = Mesh(points[used], np.searchsorted(used, half))
        refined = refine(mesh, pns(MODELS[base][number]), 2, 1.0, creases="auto").mesh
        made.append({tuple(point) for point in refined.vertices.tolist()})
    # The ends of what they share turn otherwise in each, and so do their neighbours' limits.
    assert len(made[0] & made[1]) >= 4 * 4 + 1


@over_both
@pytest.mark.parametrize("limit", [False, True])
def test_an_open_sheet_keeps_its_corners_and_its_area(base, limit):
    points, faces = grid(5) if base == "loop" else quad_grid(5)
    mesh = Mesh(points, faces)
    refined = refine(mesh, pns(MODELS[base][0]), 3, limit=limit).mesh
    corners = {(x, y, 0.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)}
    assert corners <= {tuple(point) for point in refined.vertices.tolist()}
    a, b, c = (refined.vertices[refined.triangulated().faces[:, k]] for k in range(3))
    assert np.cross(b - a, c - a)[:, 2].sum() / 2 == pytest.approx(4, rel=1e-12)


def test_marked_creases_stay_as_sharp_as_in_the_base_scheme():
    points, faces = grid(6, bent)
    marked = Creases(np.array([[14, 15], [15, 16]]))
    ours = refine(Mesh(points, faces), pns(MODELS["loop"][0]), 3, creases=marked)
    assert ours.report["levels"][-1]["edges"]["crease"] == 8
