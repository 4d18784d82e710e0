"""Blender's arrays, refined without Blender: positions are the library's, and all comes along."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addons.blender.pns_refine.refining.compute import POSITIONS, Choice, compute
from addons.blender.pns_refine.refining.creases import crease_of, crease_sharpness_of, shaded_edges
from addons.blender.pns_refine.refining.job import Job, StoppedError
from pns_common import Creases, MeshError, catmull_clark, load_model, loop, pns, refine
from pns_common.carry import rules
from pns_common.mesh.rows import dot, norm
from tests.addons.blender.quads import CUBE_POINTS, CUBE_SIDES, cube, cut, drum, grid, layer, switch
from tests.addons.blender.quads import snapshot as quads

GENERAL, NEAR = load_model(), {"tolerance": "1%"}


def bent():
    """A sheet of triangles that bends on one side alone."""
    flat = cut(grid(6))
    return replace(
        flat, points=flat.points + np.outer(np.maximum(flat.points[:, 0], 0) ** 2, [0, 0, 1])
    )


def kinds(shape, levels=2):
    """Quads over Catmull–Clark, triangles over Loop, and where they bend, without correction."""
    faces = len(shape.triangles) * 4**levels
    return {
        "quads": (shape, Choice(GENERAL, levels, budget=0.0)),
        "cut": (shape, Choice(None, levels)),
        "goal": (shape, Choice(GENERAL, levels, budget=0.0, max_faces=faces // 2)),
        "triangles": (cut(shape), Choice(None, levels, max_faces=faces)),
        "cut to a goal": (shape, Choice(None, levels, max_faces=faces)),
    }


KINDS = ["quads", "cut", "goal", "triangles", "cut to a goal"]


def named(made, name):
    """The rows of the one attribute of this name; None without any."""
    return next((each.values for each in made.layers if each.name == name), None)


def at_corners(made):
    return made.points[made.topology.corners]


# --- positions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [True, False])
@pytest.mark.parametrize("lines", [True, False])
@pytest.mark.parametrize("name", ["general", "paper", None])
@pytest.mark.parametrize("shape", [cube(), cut(cube()), grid(4)])
def test_positions_and_report_are_those_of_the_library(shape, name, lines, limit):
    model = name and load_model(name)
    mesh = shape.control(whole=name == "general" and shape.has_polygons).mesh
    scheme = pns(model) if model else loop()
    creases = "auto" if lines else None
    expected = refine(mesh, scheme, 2, creases=creases, limit=limit)
    made = compute(shape, Choice(model, 2, crease_lines=lines, limit=limit))
    np.testing.assert_allclose(made.points, expected.mesh.vertices, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(made.topology.corners, expected.mesh.corners)
    assert made.report == expected.report
    # What the overlays show: nothing without a model.
    assert (made.ratio.max() > 0) == (made.distance.max() > 0) == (model is not None)
    plain = compute(shape, Choice(model, 2, budget=0.0, limit=limit)).points
    np.testing.assert_allclose(made.distance, np.linalg.norm(made.points - plain, axis=1))


@given(st.floats(0, 1))
def test_a_crease_is_ten_times_its_square_and_back(crease):
    sharpness = crease_sharpness_of(np.array([crease]))
    assert sharpness[0] == (np.inf if crease == 1 else pytest.approx(10 * crease**2))
    assert crease_of(sharpness)[0] == pytest.approx(crease, abs=1e-7)


@pytest.mark.parametrize("limit", [True, False])
@pytest.mark.parametrize("border", ["smooth", "corners"])
@pytest.mark.parametrize("shape", [cube(), cut(cube()), grid(3), cut(grid(3))])
def test_creases_and_corners_wear_off_as_the_librarys_and_leave_the_rest(shape, border, limit):
    marks = np.resize([0, 0.4, 1, 2.5, np.inf], len(shape.edges))
    corners = np.resize([1.5, np.inf, 2.25, 0], len(shape.points))
    marked = replace(shape, crease_sharpness=marks, vertex_sharpness=corners)
    made = compute(marked, Choice(GENERAL, 2, budget=0.0, border=border, limit=limit))
    creases = Creases(
        shape.edges,
        marks,
        vertices=np.arange(len(corners)),
        vertex_sharpness=corners,
        border=border,
        wears=True,
    )
    mesh = shape.control(whole=shape.has_polygons).mesh
    scheme = catmull_clark() if shape.has_polygons else loop()
    expected = refine(mesh, scheme, 2, creases=creases, limit=limit).mesh.vertices
    np.testing.assert_allclose(made.points, expected, rtol=0, atol=1e-14)
    # Each edge's four pieces have what is left, and what is new inside faces has none.
    left = {value: 4 * int((marks == value + 2).sum()) for value in (0.5, np.inf)}
    counts = {value: int((made.crease_sharpness == value).sum()) for value in left}
    assert counts == left
    assert (made.crease_sharpness > 0).sum() == sum(left.values())
    np.testing.assert_array_equal(made.vertex_sharpness[: len(corners)], np.maximum(corners - 2, 0))


@pytest.mark.parametrize(("degrees", "sharp"), [(89.9, np.inf), (90.1, 0.0)])
def test_edges_are_sharp_above_the_angle_and_diagonals_never(degrees, sharp):
    made = compute(cube(), Choice(None, 1, crease_angle=np.radians(degrees)))
    np.testing.assert_allclose(made.points, compute(cube(sharp), Choice(None, 1)).points)
    assert (made.crease_sharpness > 0).sum() == (24 if sharp else 0)


def test_hard_edges_of_smooth_shading_are_kept_where_lines_are_asked_for():
    shape = grid(6)
    middle = (shape.edges // 7 == 3).all(axis=1)
    row, one = switch("sharp_edge", "EDGE", middle), np.arange(36) == 21
    cases = [
        ((row,), True, 12),
        ((row,), False, 0),
        ((row, switch("sharp_face", "FACE", np.ones(36))), True, 0),  # flat-shaded
        ((switch("sharp_face", "FACE", one),), True, 8),
    ]
    for layers, lines, count in cases:
        made = compute(replace(shape, layers=layers), Choice(GENERAL, 1, crease_lines=lines))
        assert (made.crease_sharpness == GENERAL.card.sharpness_levels - 1).sum() == count
        # The base scheme alone knows of none.
        plain = compute(shape, Choice(GENERAL, 1, budget=0.0)).points
        np.testing.assert_allclose(made.distance, np.linalg.norm(made.points - plain, axis=1))
    # A polygon's own diagonals have one normal on both sides.
    flat = replace(shape, layers=(switch("sharp_face", "FACE", one),))
    assert shaded_edges(flat, shape.control(whole=False))[1].sum() == 4


def test_a_goal_is_the_librarys_and_what_it_cannot_do_is_said():
    shape = bent()
    for goal in ({"max_faces": 400}, {"angle": 10.0}):
        made = compute(shape, Choice(None, 2, **goal))
        expected = refine(shape.control(whole=False).mesh, loop(), **goal)
        np.testing.assert_array_equal(made.points, expected.mesh.vertices)
        np.testing.assert_array_equal(made.topology.corners, expected.mesh.corners)
    for whole, goal in ((grid(6), {"max_faces": 400}), (drum(), {"tolerance": "1%"})):
        made = compute(whole, Choice(GENERAL, 2, **goal))
        expected = refine(whole.control(whole=True).mesh, "pns", creases="auto", **goal)
        np.testing.assert_array_equal(made.points, expected.mesh.vertices)
        np.testing.assert_array_equal(made.topology.offsets, expected.mesh.offsets)
    many = {"max_faces": 400}
    for refused, choice, words in (
        (cube(), Choice(GENERAL, 2, angle=10.0), r"Catmull–Clark.*Tolerance.*Ctrl T"),
        (cut(cube(2.5)), Choice(None, 2, **many), "set them to 1"),
        (shape, Choice(None, 2, limit=False, **many), "On Limit Surface"),
    ):
        with pytest.raises(MeshError, match=words):
            compute(refused, choice)
    assert compute(cube(), Choice(None, 2, angle=10.0)).topology.triangles


def test_lids_stay_whole_with_all_that_they_carry():
    """A drum of quads and two lids of seven corners, that get new ones on their rims."""
    shape = drum()
    corners = np.zeros((shape.polygon_corners[-1], 3))
    corners[shape.corners] = shape.points[shape.triangles]
    rims = np.ptp(shape.points[shape.edges][..., 2], axis=1) == 0
    layers = (
        layer("CORNER", rules.smooth, corners, "corners"),
        layer("FACE", rules.old, np.arange(9)[:, None], "faces"),
        switch("seam", "EDGE", rims),
    )
    sharp = replace(shape, layers=layers, crease_sharpness=np.where(rims, np.inf, 0))
    made = compute(sharp, Choice(GENERAL, 2, budget=0.0, tolerance="0.5%"))
    sizes = np.diff(made.topology.offsets)
    assert sizes[:2].min() > 7
    assert (sizes[2:] == 4).all()
    np.testing.assert_array_equal(named(made, "faces")[:2, 0], [0, 1])
    assert named(made, "seam").sum() == (made.crease_sharpness > 0).sum() == sizes[:2].sum()
    # On both sides of the rims values are those of the control mesh's sides.
    of_vertex = np.empty((len(made.points), 3))
    of_vertex[made.topology.corners] = named(made, "corners")
    np.testing.assert_allclose(named(made, "corners"), of_vertex[made.topology.corners], atol=1e-12)
    normals, walls = named(made, "normals"), slice(sizes[:2].sum(), None)
    np.testing.assert_allclose(np.abs(normals[: walls.start]).min(axis=0), [0, 0, 1], atol=1e-6)
    out = at_corners(made)[walls] * [1, 1, 0]
    np.testing.assert_allclose(dot(normals[walls], out), norm(out), atol=0.02)


# --- what comes along -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_attributes_that_are_the_positions_follow_them(kind):
    shape, choice = kinds(grid(6))[kind]
    corners = np.zeros((shape.polygon_corners[-1], 3))
    corners[shape.corners] = shape.points[shape.triangles]
    layers = [
        layer("POINT", rules.smooth, shape.points, "points"),
        layer("CORNER", rules.smooth, corners, "corners"),
    ]
    offsets, groups = np.stack([shape.points, 0 * shape.points + 1]), shape.points[:, :1]
    made = compute(replace(shape, layers=layers, offsets=offsets, groups=groups), choice)
    np.testing.assert_allclose(named(made, "points"), made.points)
    np.testing.assert_allclose(made.offsets[0], made.points, atol=1e-12)
    np.testing.assert_allclose(made.offsets[1], 1)
    np.testing.assert_allclose(made.groups, np.clip(made.points[:, :1], 0, 1), atol=1e-12)
    inside = (np.abs(at_corners(made)[:, :2]) < 0.6).all(axis=1)
    # To a goal corners are linear in each face, or bilinear.
    atol = 1e-9 if kind in ("quads", "cut") else 0.04
    np.testing.assert_allclose(named(made, "corners")[inside], at_corners(made)[inside], atol=atol)


@pytest.mark.parametrize("kind", KINDS)
def test_labels_are_one_of_those_around_and_marks_of_one_vertex_do_not_spread(kind):
    shape, choice = kinds(grid(5))[kind]
    right = (shape.points[:, :1] > 0).astype(int) * 7
    corners, faces = np.arange(shape.polygon_corners[-1])[:, None], len(shape.polygon_corners) - 1
    layers = [
        layer("POINT", rules.vote, right, "side"),
        layer("POINT", rules.old, right + 1, "kept"),
        layer("CORNER", rules.vote, corners, "corners"),
        layer("FACE", rules.old, np.arange(faces)[:, None], "faces"),
    ]
    made = compute(replace(shape, layers=layers), choice)
    far, old = np.abs(made.points[:, 0]) > 0.41, len(shape.points)
    np.testing.assert_array_equal(named(made, "side")[far, 0] == 7, made.points[far, 0] > 0)
    np.testing.assert_array_equal(named(made, "kept")[:old], right + 1)
    assert not named(made, "kept")[old:].any()
    np.testing.assert_array_equal(named(made, "faces")[:, 0], made.polygons)
    owner = np.searchsorted(shape.polygon_corners, named(made, "corners")[:, 0], side="right") - 1
    np.testing.assert_array_equal(owner, np.repeat(made.polygons, np.diff(made.topology.offsets)))


@pytest.mark.parametrize("kind", KINDS)
def test_each_edge_falls_into_a_chain_of_its_pieces(kind):
    shape, choice = kinds(cube())[kind]
    numbers = np.arange(1, len(shape.edges) + 1)[:, None]
    made = compute(replace(shape, layers=(layer("EDGE", rules.old, numbers),)), choice)
    values = named(made, "mine")[:, 0]
    for number, edge in enumerate(shape.edges, 1):
        ends, counts = np.unique(made.edges[values == number], return_counts=True)
        assert sorted(ends[counts == 1]) == sorted(edge)


@pytest.mark.parametrize("kind", ["quads", "cut"])
def test_both_sides_of_a_seam_divide_it_alike(kind):
    """Every side of the cube is a patch: its border must stay straight and evenly divided."""
    values = np.random.default_rng(0).random((24, 2))
    shape, choice = kinds(cube(np.inf, layer("CORNER", rules.smooth, values)))[kind]
    made = compute(shape, choice)
    owner, checked = np.repeat(made.polygons, np.diff(made.topology.offsets)), 0
    for place, side, value in zip(at_corners(made), owner, named(made, "mine"), strict=True):
        ring, own = CUBE_POINTS[CUBE_SIDES[side]], values[4 * side : 4 * side + 4]
        for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
            along = (place - ring[i]) @ (ring[j] - ring[i]) / 4
            if np.allclose(place, ring[i] + along * (ring[j] - ring[i])):
                np.testing.assert_allclose(value, (1 - along) * own[i] + along * own[j], atol=1e-12)
                checked += 1
    assert checked >= 6 * 4 * 4


@pytest.mark.parametrize("keep", ["all", "corners only", "boundaries", "none"])
def test_uv_maps_stay_where_that_is_asked_for(keep):
    shape = cut(grid(4))
    flat = shape.points[:, :2]
    uv = layer("CORNER", rules.smooth, flat[shape.triangles].reshape(-1, 2), kind="FLOAT2")
    made = compute(replace(shape, layers=(uv,)), Choice(None, 2, uv_keep=keep))
    moved = np.zeros((len(made.points), 2))
    moved[made.topology.corners] = named(made, "mine")
    stays = np.isclose(moved[: len(flat)], flat).all(axis=1)
    border = np.abs(flat).max(axis=1) > 1 - 1e-9
    alone = np.bincount(shape.triangles.reshape(-1)) == 1
    if keep == "none":
        np.testing.assert_allclose(moved, made.points[:, :2], atol=1e-12)
    else:
        assert stays[{"all": stays >= 0, "boundaries": border, "corners only": alone}[keep]].all()
    assert stays[border].all() == (keep in ("all", "boundaries"))


def test_edges_without_faces_stay_and_vertices_that_only_look_joined_are_counted():
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    beside = points + np.array([1, 0, 0])
    apart = quads(np.concatenate([points, beside]), np.arange(8).reshape(2, 4))
    assert compute(apart, Choice(None, 1)).split_vertices == 4
    edges, marks = np.r_[apart.edges, [[0, 6]]], np.r_[apart.crease_sharpness, 1.5]
    loose = compute(replace(apart, edges=edges, crease_sharpness=marks), Choice(None, 1))
    assert (loose.edges[-1].tolist(), loose.crease_sharpness[-1]) == ([0, 6], 1.5)
    assert compute(cube(), Choice(None, 1)).split_vertices == 0


# --- shading --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "goal"),
    [(cube(), {}), (cut(cube()), {}), (cube(), NEAR), (cut(cube()), NEAR)],
)
def test_a_flat_cube_comes_out_smooth_between_marked_edges(shape, goal):
    flat = switch("sharp_face", "FACE", np.ones(len(shape.polygon_corners) - 1))
    made = compute(replace(shape, layers=(flat,)), Choice(GENERAL, 2, **goal))
    assert named(made, "sharp_face") is None
    ends = made.points[made.edges[named(made, "sharp_edge")[:, 0]]]
    assert len(ends) == 12 * (1 if goal else 4)
    assert (np.isclose(np.abs(ends), 1, atol=0.01).all(axis=1).sum(axis=1) >= 2).all()
    # The normal of each side at all of its corners, also at the cube's own.
    normals, starts = named(made, "normals"), made.topology.offsets
    centres = np.add.reduceat(at_corners(made), starts[:-1]) / np.diff(starts)[:, None]
    facing = (normals * np.repeat(centres, np.diff(starts), axis=0)).sum(axis=1)
    assert (np.abs(normals).max(axis=1) > 0.99).all()
    assert (facing > 0.6).all()


def test_marks_and_flat_faces_of_the_mesh_stay_where_nothing_is_found():
    shape = grid(4)
    own = switch("sharp_edge", "EDGE", np.arange(len(shape.edges)) < 3)
    made = compute(replace(shape, layers=(own,)), Choice(None, 1))
    assert named(made, "sharp_edge").sum() == 6
    expected = refine(shape.control(whole=False).mesh, loop(), 1, creases=None).normals
    plain = compute(shape, Choice(None, 1))
    np.testing.assert_allclose(named(plain, "normals"), expected[plain.topology.corners], atol=1e-9)
    some = replace(shape, layers=(switch("sharp_face", "FACE", np.arange(16) < 1),))
    flat = compute(some, Choice(None, 1))
    # Free normals would hide that they are flat, and only the limit has any.
    assert named(flat, "sharp_face").sum() == 8
    assert named(flat, "normals") is None
    assert named(compute(shape, Choice(None, 1, limit=False)), "normals") is None
    whole = replace(shape, layers=(switch("sharp_face", "FACE", np.ones(16)),))
    assert named(compute(whole, Choice(None, 1)), "sharp_face") is None


# --- the work -------------------------------------------------------------------------------------


def test_progress_rises_inside_a_level_and_can_stop_the_work():
    told = []
    compute(grid(100), Choice(GENERAL, 1), told.append)
    assert told == sorted(told)
    assert told[-1] <= 1
    assert sum(share < POSITIONS for share in told) >= 3
    with pytest.raises(ZeroDivisionError):
        compute(grid(4), Choice(None, 2), lambda share: 1 / 0)


def test_a_job_answers_stops_at_its_next_report_and_hands_on_errors():
    job = Job(lambda report: 42)
    assert (job.answer(), job.share, job.running) == (42, 1, False)
    started, go_on, reached = threading.Event(), threading.Event(), []

    def work(report):
        report(0.25)
        started.set()
        go_on.wait()
        report(0.5)
        reached.append("the end")

    job = Job(work)
    started.wait()
    assert (job.running, job.share) == (True, 0.25)
    job.cancel()
    go_on.set()
    with pytest.raises(StoppedError):
        job.answer()
    assert not reached
    with pytest.raises(ZeroDivisionError):
        Job(lambda report: 1 / 0).answer()
