"""Values on points, edges, faces and corners: each comes from its place and goes to it."""

from dataclasses import replace

import numpy as np
import pytest

from addons.blender.pns_refine.refining.compute import SHARES, Choice, compute
from addons.blender.pns_refine.refining.snapshot import Domain, Layer, Rule, Smoothing
from pns_common import Mesh, load_model, loop, refine
from tests.addons.blender.quads import CUBE_POINTS, CUBE_SIDES, cube, cut, grid, snapshot


def carried(shape, domain, rule, values, levels=1, *, quads=False):
    """The rows of a layer after refinement, and the refined mesh."""
    layer = Layer("mine", "FLOAT", domain, rule, np.asarray(values))
    shape = type(shape)(**{**shape.__dict__, "layers": (layer,)})
    # Without a budget it is Catmull–Clark.
    made = compute(shape, Choice(load_model() if quads else None, levels, budget=0.0))
    return made.layers[0].values, made


@pytest.mark.parametrize("quads", [False, True])
def test_positions_as_an_attribute_become_the_positions(quads):
    shape = grid(4)
    carried_values, made = carried(shape, Domain.POINT, Rule.BLEND, shape.points, 2, quads=quads)
    np.testing.assert_allclose(carried_values, made.points)


@pytest.mark.parametrize(("low", "high"), [(1, 2), (2, 1)])
def test_votes_go_to_the_value_of_most_parents(low, high):
    values = np.where(np.arange(8)[:, None] < 5, low, high)
    carried_values, made = carried(cube(), Domain.POINT, Rule.VOTE, values)
    np.testing.assert_array_equal(carried_values[:8], values)
    # The ends of edge 3, 7 differ, and the corners opposite to it, 1 and 2, agree with 3.
    beside = [set(made.edges[(made.edges == end).any(axis=1)].ravel()) for end in (3, 7)]
    (middle,) = (beside[0] & beside[1]) - {3, 7}
    assert carried_values[middle, 0] == low


@pytest.mark.parametrize("quads", [False, True])
def test_a_new_vertex_between_equals_has_their_value(quads):
    shape = grid(5)
    values = (shape.points[:, :1] > 0).astype(int) * 7
    carried_values, made = carried(shape, Domain.POINT, Rule.VOTE, values, quads=quads)
    far = np.abs(made.points[:, 0]) > 0.41
    np.testing.assert_array_equal(carried_values[far, 0], np.where(made.points[far, 0] > 0, 7, 0))


def test_values_of_one_vertex_do_not_spread():
    values = np.arange(1, 9)[:, None]
    carried_values, _ = carried(cube(), Domain.POINT, Rule.KEEP, values)
    np.testing.assert_array_equal(carried_values[:8], values)
    assert not carried_values[8:].any()


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("quads", [False, True])
def test_each_edge_falls_into_its_pieces(levels, quads):
    values = np.arange(1, 13)[:, None]
    carried_values, made = carried(
        cube(np.inf), Domain.EDGE, Rule.KEEP, values, levels, quads=quads
    )
    counts = np.bincount(carried_values.ravel())
    np.testing.assert_array_equal(counts[1:], 2**levels)
    # The cube's edges are sharp, so their pieces lie on them.
    ends = CUBE_POINTS[cube().edges]
    for row, edge in zip(carried_values.ravel(), made.edges, strict=True):
        if row:
            low, high = np.sort(ends[row - 1], axis=0)
            assert (made.points[edge] >= low - 1e-12).all()
            assert (made.points[edge] <= high + 1e-12).all()


@pytest.mark.parametrize("quads", [False, True])
def test_faces_keep_what_their_polygon_had(quads):
    carried_values, made = carried(
        cube(np.inf), Domain.FACE, Rule.KEEP, np.arange(6)[:, None], 2, quads=quads
    )
    assert len(carried_values) == (96 if quads else 192)
    for row, start, end in zip(
        carried_values.ravel(), made.faces.starts, made.faces.starts[1:], strict=False
    ):
        side = CUBE_POINTS[CUBE_SIDES[row]]
        flat = np.ptp(side, axis=0) == 0
        corners = made.points[made.faces.vertices[start:end]]
        assert np.allclose(corners[:, flat], side[0, flat])


@pytest.mark.parametrize("quads", [False, True])
def test_corner_values_that_are_the_positions_follow_them(quads):
    shape = grid(6)
    values = np.zeros((4 * 36, 3))
    values[shape.corners.ravel()] = shape.points[shape.triangles.ravel()]
    carried_values, made = carried(shape, Domain.CORNER, Rule.BLEND, values, 1, quads=quads)
    inside = (np.abs(made.points[made.faces.vertices, :2]) < 0.6).all(axis=1)
    assert inside.any()
    np.testing.assert_allclose(carried_values[inside], made.points[made.faces.vertices][inside])


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("quads", [False, True])
def test_both_sides_of_a_seam_divide_it_alike(levels, quads):
    """Every side of the cube is a patch: its border must stay straight and evenly divided."""
    values = np.random.default_rng(0).random((24, 2))
    asked = cube(np.inf), Domain.CORNER, Rule.BLEND, values, levels
    carried_values, made = carried(*asked, quads=quads)
    checked = 0
    for corner, vertex in enumerate(made.faces.vertices):
        side = made.faces.parents[corner // (4 if quads else 3)]
        ring = CUBE_POINTS[CUBE_SIDES[side]]
        for i in range(4):
            start, end = ring[i], ring[(i + 1) % 4]
            along = (made.points[vertex] - start) @ (end - start) / ((end - start) @ (end - start))
            if np.allclose(made.points[vertex], start + along * (end - start)):
                # On a sharp edge with fixed ends, points divide it evenly after one level.
                expected = (1 - along) * values[4 * side + i] + along * values[
                    4 * side + (i + 1) % 4
                ]
                np.testing.assert_allclose(carried_values[corner], expected, atol=1e-12)
                checked += 1
    assert checked


@pytest.mark.parametrize("quads", [False, True])
def test_corner_votes_take_values_that_were_there(quads):
    values = np.arange(24)[:, None]
    carried_values, made = carried(cube(), Domain.CORNER, Rule.VOTE, values, 2, quads=quads)
    sides = np.repeat(made.faces.parents, 4 if quads else 3)
    np.testing.assert_array_equal(carried_values.ravel() // 4, sides)


def test_quads_come_back_whole_and_outward():
    made = compute(cube(np.inf), Choice(load_model(), 3))
    sizes = np.diff(made.faces.starts)
    np.testing.assert_array_equal(sizes, 4)
    ring = made.points[made.faces.vertices.reshape(-1, 4)]
    normal = np.cross(ring[:, 2] - ring[:, 0], ring[:, 3] - ring[:, 1])
    assert ((normal * ring.mean(axis=1)).sum(axis=1) > 0).all()
    ends = np.sort(made.edges[made.faces.edges].reshape(-1, 4, 2), axis=-1)
    vertices = made.faces.vertices.reshape(-1, 4)
    expected = np.sort(np.stack([vertices, np.roll(vertices, -1, axis=1)], axis=-1), axis=-1)
    np.testing.assert_array_equal(ends, expected)


def test_edges_without_faces_stay_as_they_are():
    shape = cube()
    shape = type(shape)(
        **{
            **shape.__dict__,
            "points": np.concatenate([shape.points, [[3, 0, 0], [4, 0, 0]]]),
            "edges": np.concatenate([shape.edges, [[8, 9]]]),
            "crease_sharpness": np.append(shape.crease_sharpness, 0.0),
            "vertex_sharpness": np.zeros(10),
            "groups": np.zeros((10, 0)),
        }
    )
    made = compute(shape, Choice(None, 1))
    assert made.edges[-1].tolist() == [8, 9]
    np.testing.assert_array_equal(made.points[8:10], [[3, 0, 0], [4, 0, 0]])


def test_groups_stay_between_none_and_all_and_offsets_are_linear():
    shape = grid(4)
    rng = np.random.default_rng(0)
    lift = np.tile([0.0, 0.0, 1.0], (len(shape.points), 1))
    shape = type(shape)(
        **{
            **shape.__dict__,
            "groups": rng.random((len(lift), 3)),
            "offsets": np.stack([lift, -2 * lift]),
        }
    )
    made = compute(shape, Choice(None, 2))
    assert made.groups.min() >= 0
    assert made.groups.max() <= 1
    np.testing.assert_allclose(
        made.offsets[0], np.tile([0, 0, 1], (len(made.points), 1)), atol=1e-12
    )
    np.testing.assert_allclose(made.offsets[1], -2 * made.offsets[0])


def test_progress_rises_and_can_stop_the_work():
    told = []
    compute(grid(4), Choice(None, 2), told.append)
    assert told == sorted(told)
    assert 0 < told[-1] <= 1

    class EnoughError(Exception):
        pass

    def stop(share):
        raise EnoughError

    with pytest.raises(EnoughError):
        compute(grid(4), Choice(None, 2), stop)


def test_the_work_stops_between_blocks_of_one_level():
    shape, told = grid(100), []
    compute(shape, Choice(load_model("paper"), 1), told.append)
    # The only level of positions ends at this share of the work.
    assert sum(share < SHARES["positions"] for share in told) >= 3


def test_vertices_that_only_look_joined_are_counted():
    """Two quads side by side, whose common side is there twice."""
    places = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (1, 0, 0),
        (2, 0, 0),
        (2, 1, 0),
        (1, 1, 0),
    ]
    apart = snapshot(np.array(places, float), np.array([(0, 1, 2, 3), (4, 5, 6, 7)]), 0.0, ())
    assert compute(apart, Choice(None, 1)).split_vertices == 4
    assert compute(cube(), Choice(None, 1)).split_vertices == 0
    assert compute(grid(2), Choice(None, 1)).split_vertices == 0


@pytest.mark.parametrize("smoothing", list(Smoothing))
def test_uv_maps_are_smoothed_as_asked(smoothing):
    shape = grid(4)
    values = shape.points[:, :2][shape.triangles].reshape(-1, 2)
    layer = Layer("UV", "FLOAT2", Domain.CORNER, Rule.BLEND, values)
    triangles = replace(cut(shape), layers=(layer,))
    made = compute(triangles, Choice(None, 2, uv_smooth=smoothing))
    uv = np.zeros((len(made.points), 2))
    uv[made.faces.vertices] = made.layers[0].values
    mesh = Mesh(np.pad(shape.points[:, :2], [(0, 0), (0, 1)]), shape.triangles)
    loops = refine(mesh, loop(), 2).mesh.vertices[:, :2]
    flat = mesh.vertices[:, :2]
    stays = np.isclose(uv[: len(flat)], flat).all(axis=1)
    alone = np.bincount(shape.triangles.reshape(-1)) == 1
    border = np.abs(np.abs(flat).max(axis=1) - np.abs(flat).max()) < 1e-9
    if smoothing is Smoothing.SMOOTH_ALL:
        np.testing.assert_allclose(uv, loops, atol=1e-12)
    elif smoothing is Smoothing.NONE:
        assert stays.all()
    else:
        assert stays[border if smoothing is Smoothing.PRESERVE_BOUNDARIES else alone].all()
    if smoothing is Smoothing.PRESERVE_CORNERS:
        moved = np.abs(loops[: len(flat)] - flat).max(axis=1) > 1e-9
        assert not stays[border & moved & ~alone].any()
