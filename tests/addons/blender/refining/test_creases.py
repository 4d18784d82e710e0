"""Creases for good, creases that wear off, and creases by angle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addons.blender.pns_refine.refining.compute import Choice, compute
from addons.blender.pns_refine.refining.steps import (
    crease_of,
    crease_sharpness_of,
    level_steps,
    refine_columns,
)
from pns_common import Creases, Mesh, catmull_clark, load_model, loop, pns
from pns_common.carry.columns import level_topologies
from pns_common.carry.columns import refine_columns as refine_by_library
from pns_common.mesh.topology import build_topology
from pns_common.model.file import DEFAULT_MODEL
from pns_common.operator.sharpness import creases_by_name
from pns_common.schemes import CATMULL_CLARK, LOOP
from tests.addons.blender.quads import cube, cut, grid
from tests.support.control_points import refine


def points(snapshot, levels=1, **choice):
    return compute(snapshot, Choice(None, levels, **{"limit": False, **choice})).points


@given(st.floats(0, 1))
def test_a_crease_is_ten_times_its_square_and_back(crease):
    crease_sharpness = crease_sharpness_of(np.array([crease]))
    assert crease_sharpness[0] == (np.inf if crease == 1 else pytest.approx(10 * crease**2))
    assert crease_of(crease_sharpness)[0] == pytest.approx(crease, abs=1e-7)


@pytest.mark.parametrize("model", [None, "paper", DEFAULT_MODEL])
def test_without_creases_it_is_the_operator(model):
    whole, shape, model = model == DEFAULT_MODEL, grid(4), model and load_model(model)
    scheme, mesh = pns(model) if model else loop(), shape.control(whole=whole).mesh
    expected = refine(mesh, scheme, 2, creases=None)
    computed = compute(shape, Choice(model, 2, crease_lines=False, limit=False))
    np.testing.assert_array_equal(computed.points, expected.mesh.vertices)
    assert computed.report == expected.report
    learned = scheme.learned_levels
    acted = expected if learned in (None, 0) else refine(mesh, scheme, 1, creases=None)
    np.testing.assert_array_equal(computed.ratio[: len(acted.ratio)], acted.ratio)
    assert (computed.ratio.max() > 0) == (model is not None)


def test_a_crease_for_good_is_the_operators():
    shape = cube(np.inf)
    expected = refine(Mesh(shape.points, shape.triangles), loop(), 3, creases=shape.edges)
    np.testing.assert_array_equal(points(shape, 3), expected.mesh.vertices)


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_sharpness_of_all_levels_is_sharpness_for_good(levels):
    np.testing.assert_allclose(points(cube(levels), levels), points(cube(np.inf), levels))


def test_sharpness_ends_after_its_levels():
    shape, sharp = cube(1.0), cube(np.inf)
    first = refine(Mesh(sharp.points, sharp.triangles), loop(), 1, creases=sharp.edges)
    then = refine(first.mesh, loop(), 1)
    np.testing.assert_allclose(points(shape, 2), then.mesh.vertices)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.8])
def test_part_of_a_level_mixes_sharp_and_smooth(share):
    mixed = (1 - share) * points(cube(0.0)) + share * points(cube(np.inf))
    np.testing.assert_allclose(points(cube(share)), mixed)


def test_a_vertex_is_as_sharp_as_its_edges_on_average():
    shape = cube()
    at_corner = (shape.edges == 0).any(axis=1)
    shape.crease_sharpness[at_corner] = [0.2, 0.4, 0.9]
    smooth, sharp = points(cube(0.0)), points(cube(np.where(at_corner, np.inf, 0)))
    np.testing.assert_allclose(points(shape)[0], 0.5 * smooth[0] + 0.5 * sharp[0])


@pytest.mark.parametrize("base", [LOOP, CATMULL_CLARK])
def test_columns_go_through_the_same_masks_as_positions(base):
    model = load_model() if base.polygons else None
    for crease_sharpness in (0.0, 0.4, 1.0, 1.7, np.inf):
        shape = cube(crease_sharpness)
        control = shape.control(whole=base.polygons).mesh.topology()
        steps = level_steps(control, base, 2, shape.edges, shape.crease_sharpness)
        made = compute(shape, Choice(model, 2, budget=0.0, limit=False)).points
        np.testing.assert_allclose(refine_columns(shape.points, steps), made, atol=1e-14)


def test_columns_without_creases_are_those_of_the_library():
    shape = grid(3)
    columns = np.random.default_rng(0).normal(size=(len(shape.points), 4))
    control = build_topology(shape.triangles, len(columns))
    steps = level_steps(control, LOOP, 2, shape.edges, shape.crease_sharpness)
    expected = refine_by_library(columns, level_topologies(shape.triangles, len(columns), 2))
    np.testing.assert_array_equal(refine_columns(columns, steps), expected)


def test_what_is_left_stands_on_the_halves():
    made = compute(cube(2.5), Choice(None, 2))
    assert sorted(set(made.crease_sharpness)) == [0, 0.5]
    assert (made.crease_sharpness > 0).sum() == 12 * 4
    assert not (compute(cube(2.5), Choice(None, 3)).crease_sharpness > 0).any()


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("crease_sharpness", [0.0, 0.4, np.inf])
def test_sharp_vertices_are_the_librarys_and_wear_off(whole, crease_sharpness):
    shape, sharpness = cube(), [1.5, np.inf, 2.25]
    shape.crease_sharpness[:4], shape.vertex_sharpness[:3] = crease_sharpness, sharpness
    shape, base = (shape, catmull_clark()) if whole else (cut(shape), loop())
    made = compute(shape, Choice(load_model(), 2, budget=0.0, limit=False))
    if crease_sharpness != 0.4:
        edges = shape.edges[:4] if crease_sharpness else None
        kept = Creases(edges, vertices=[0, 1, 2], vertex_sharpness=sharpness)
        mesh = shape.control(whole=whole).mesh
        expected = refine(mesh, base, 2, creases=kept).mesh.vertices
        np.testing.assert_allclose(made.points, expected, atol=1e-14)
    np.testing.assert_allclose(made.points[1], shape.points[1], atol=1e-14)
    assert made.vertex_sharpness[:3].tolist() == [0, np.inf, 0.25]
    assert not made.vertex_sharpness[3:].any()


@pytest.mark.parametrize(("degrees", "sharp"), [(89.9, True), (90.1, False)])
def test_edges_are_sharp_above_the_angle(degrees, sharp):
    placed = points(cube(), 1, crease_angle=np.radians(degrees))
    np.testing.assert_allclose(placed, points(cube(np.inf if sharp else 0.0)))


def test_diagonals_of_flat_quads_are_never_sharp():
    made = compute(cube(), Choice(None, 1, crease_angle=0.01))
    assert (made.crease_sharpness > 0).sum() == 24


@pytest.mark.parametrize("kept", [True, False])
def test_lines_are_kept_where_the_model_asks_for_them(kept):
    shape, model = cut(cube()), load_model(DEFAULT_MODEL)
    deep = compute(shape, Choice(model, 3, crease_lines=kept, limit=False))
    assert not deep.crease_sharpness.any()
    creases = "auto" if kept else None
    expected = refine(Mesh(shape.points, shape.triangles), pns(model), 3, creases=creases)
    np.testing.assert_array_equal(deep.points, expected.mesh.vertices)
    of_loop = compute(cube(), Choice(None, 1, crease_lines=kept, limit=False))
    assert not (of_loop.crease_sharpness > 0).any()


def test_a_mixture_stays_within_the_budget_of_loops():
    made = compute(cube(0.6), Choice(load_model("paper"), 2))
    assert [level["faces"] for level in made.report["levels"]] == [48, 192]
    assert made.distance.max() > 0
    assert all(level["proximity_ratio"]["max"] <= 1 + 1e-12 for level in made.report["levels"])


def test_the_limit_is_what_many_levels_come_to():
    for crease_sharpness in (0.0, np.inf):
        near = points(cube(crease_sharpness), 1, limit=True)
        deep = points(cube(crease_sharpness), 7)
        np.testing.assert_allclose(near, deep[: len(near)], atol=2e-4)


def test_offsets_go_to_the_limit_with_the_points():
    shape = cube()
    shape = type(shape)(**{**shape.__dict__, "offsets": shape.points[None].copy()})
    made = compute(shape, Choice(None, 1, limit=True))
    np.testing.assert_allclose(made.offsets[0], made.points, atol=1e-12)
    assert made.normals is not None


def test_what_is_left_of_a_crease_is_sharp_at_the_limit():
    worn, sharp = points(cube(1.5), 1, limit=True), points(cube(np.inf), 1, limit=True)
    np.testing.assert_allclose(worn, sharp, atol=1e-12)
    smooth = compute(cube(0.5), Choice(None, 1, limit=True))
    assert np.abs(smooth.points - sharp).max() > 0.1


def test_the_report_of_a_mixture_adds_up():
    report = compute(cube(1.5), Choice(load_model("paper"), 2)).report
    assert report["learned_levels"] == 2
    assert report["limit_distance"] <= report["limit_distance_bound"] * (1 + 1e-9)


@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("shape", [cube(), cube(0.4), grid(4), cut(cube(0.4))])
def test_the_distance_is_that_to_what_the_plain_scheme_makes_of_the_same_mesh(shape, limit):
    made = compute(shape, Choice(load_model(DEFAULT_MODEL), 2, limit=limit))
    plain = compute(shape, Choice(load_model(DEFAULT_MODEL), 2, budget=0.0, limit=limit)).points
    np.testing.assert_allclose(made.distance, np.linalg.norm(made.points - plain, axis=1))
    assert 0 < made.distance.max() <= made.report["limit_distance"] * (1 + 1e-12)


@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("levels", [1, 2, 3])
def test_lines_make_the_operators_report_and_limits_of_all_that_moves(levels, limit):
    shape, model = cut(cube()), load_model(DEFAULT_MODEL)
    shape = type(shape)(**{**shape.__dict__, "offsets": shape.points[None].copy()})
    made = compute(shape, Choice(model, levels, limit=limit))
    mesh = Mesh(shape.points, shape.triangles)
    expected = refine(mesh, pns(model), levels, limit=limit)
    np.testing.assert_allclose(made.points, expected.mesh.vertices, atol=1e-14)
    for name in ("learned_levels", "limit_distance", "limit_distance_bound"):
        assert made.report[name] == pytest.approx(expected.report[name], rel=1e-12)
    # Offsets go through the masks that place the points.
    scheme = pns(model)
    lines = creases_by_name(mesh, scheme.creases, scheme)
    by_loop = refine(mesh, loop(), levels, limit=limit, creases=lines).mesh.vertices
    np.testing.assert_allclose(made.offsets[0], by_loop, atol=1e-14)


@pytest.mark.parametrize("limit", [False, True])
@given(seed=st.integers(0, 1000), levels=st.integers(1, 3), whole=st.booleans())
@settings(max_examples=20, deadline=None)
def test_creases_that_wear_off_stay_as_near_to_the_plain_scheme_as_the_report_says(
    seed, levels, whole, limit
):
    rng = np.random.default_rng(seed)
    shape = cube(rng.choice([0, 0.4, 1, 1.5, 2, np.inf], size=len(cube().edges)))
    choice = Choice(load_model(DEFAULT_MODEL), levels, limit=limit)
    made = compute(shape if whole else cut(shape), choice)
    mesh, base = shape.control(whole=whole).mesh, catmull_clark() if whole else loop()
    plain = refine(mesh, base, levels, limit=limit).mesh.vertices
    apart = np.linalg.norm(made.points - plain, axis=1).max()
    assert apart <= made.report["limit_distance"] * (1 + 1e-12)


@pytest.mark.parametrize("crease_sharpness", [0.0, 0.4])
@pytest.mark.parametrize("shape", [grid(3), cut(grid(3))])
def test_corners_of_the_boundary_stay_where_that_is_asked_for(shape, crease_sharpness):
    shape.crease_sharpness[8] = crease_sharpness
    corners, model = [0, 3, 12, 15], load_model()
    kept = compute(shape, Choice(model, 2, border="corners")).points[corners]
    smooth = compute(shape, Choice(model, 2)).points[corners]
    alone = np.bincount(shape.control(whole=shape.has_polygons).mesh.corners)[corners] == 1
    np.testing.assert_allclose(kept[alone], shape.points[corners][alone], atol=1e-14)
    # The default model keeps corners of borders by itself.
    assert np.linalg.norm(smooth - shape.points[corners], axis=1)[alone].max() < 0.01
    np.testing.assert_allclose(kept[~alone], smooth[~alone])
