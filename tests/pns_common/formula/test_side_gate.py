"""Gates that read the sides of an edge's faces: open on a bent wall's quads, shut on a box."""

import numpy as np
import pytest

from pns_common import Mesh, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.formula.side_gate import face_bends, gentle_bend, opened, opened_where_shut
from pns_common.rules.control_level import control_level
from tests.support.meshes import folded_sheet, grid, rotation, torus_of_quads
from tests.support.networks import scale_free_model
from tests.support.quasi_interpolation import OPEN_GATES, quasi_interpolated, with_card

PRIOR_ALONE = scale_free_model(0, 0.0)


def test_side_gates_leave_quasi_interpolation_whole_where_two_faces_lie_in_one_plane():
    """On quads that are plane, cut in two, a gate of the two faces leaves their diagonals out."""
    points, faces = torus_of_quads(24, 14)
    expected = quasi_interpolated(points, faces)
    of_sides, of_faces = both_gates(points, faces)
    np.testing.assert_allclose(of_sides, expected, rtol=0, atol=1e-12)
    assert (np.abs(of_faces - expected).max(axis=1) > 1e-4).sum() > 200


def test_side_gates_open_the_walls_of_a_prism_of_one_row_and_not_its_lids():
    points, faces = prism(16)
    edges = build_topology(faces, len(points)).edges
    on_lid = np.concatenate([np.arange(len(points)) >= 32, (edges >= 32).any(axis=1)])
    of_sides, of_faces = both_gates(points, faces)
    expected = quasi_interpolated(points, faces)
    np.testing.assert_allclose(of_sides[~on_lid], expected[~on_lid], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(of_sides[on_lid], of_faces[on_lid])
    assert (np.abs(of_faces - of_sides).max(axis=1) > 1e-3).sum() == 16


def test_side_gates_stay_shut_on_flat_sides_between_right_angles():
    of_sides, of_faces = both_gates(*box_of_quads(4))
    np.testing.assert_array_equal(of_sides, of_faces)


def test_bends_count_while_they_are_gentle():
    """Of each face a third of x f(x), f from 1 at 0.3 to 0 at 0.6."""
    topology = build_topology(np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]), 4)
    beside = (topology.face_edges == 2).any(axis=1)
    assert beside.sum() == 2
    for x, counted in ((0.0, 0.0), (0.2, 0.2), (0.45, 0.225), (0.6, 0.0), (1.3, 0.0)):
        bends = face_bends(np.where(np.arange(6) == 2, x, 0.0), topology)
        np.testing.assert_allclose(bends, np.where(beside, counted / 3, 0.0), atol=1e-15)


def test_a_side_gate_opens_where_both_faces_bend():
    first, second = np.array([0, 1e-3, 0.1, 0.1]), np.array([0.1, 0.1, 0.2, 0.0])
    np.testing.assert_allclose(gentle_bend(first, second, 1e4), [0, 1, 1, 0], atol=1e-8)
    np.testing.assert_allclose(opened(np.array([0.0, 0.5, 1.0]), np.full(3, 0.5)), [0.5, 0.75, 1])


@pytest.mark.parametrize("wide_open", [0.0, 0.3, 0.9, 1.0])
def test_where_w_is_1_the_gate_is_whatever_the_faces_say(wide_open):
    rng = np.random.default_rng(2)
    # Of all sizes: close to 0, close to 1, and between.
    gates = np.concatenate([2.0 ** -rng.uniform(0, 60, 999), 1 - 2.0 ** -rng.uniform(0, 54, 999)])
    by = np.where(rng.random(len(gates)) < wide_open, 1.0, rng.random(len(gates)))
    asked = []

    def gate(curvature):
        asked.append(len(curvature))
        return curvature

    np.testing.assert_array_equal(opened_where_shut(gate, gates, by), opened(gates, by))
    few = 2 * np.count_nonzero(by < 1) <= len(by)
    assert sum(asked) == (np.count_nonzero(by < 1) if few else len(by))


def test_the_last_row_of_a_sheet_moves_with_the_others():
    """Next to a boundary every other face of a sheet that bends one way has no bent side."""
    points, faces = sheet(rows=4, columns=6)
    level = control_level(points, build_topology(faces, len(points)))
    bends = face_bends(level.rings.edge_jumps, level.topology)
    expected = (1 - np.cos(0.3)) / 3  # one side of three, as inside
    np.testing.assert_allclose(bends, expected, rtol=1e-9)


def test_a_face_at_a_boundary_takes_the_largest_of_its_own_bend_and_its_neighbours():
    points, faces = grid(5)
    topology = build_topology(faces, len(points))
    jumps = np.zeros(len(topology.edges))
    jumps[topology.interior] = np.random.default_rng(0).uniform(0, 0.3, len(topology.interior))
    own, corners = (
        jumps[topology.face_edges].sum(axis=1) / 3,
        [set(face) for face in faces.tolist()],
    )
    beside = [[g for g in range(len(faces)) if len(face & corners[g]) >= 2] for face in corners]
    expected = [max(own[g]) if len(g) < 4 else own[f] for f, g in enumerate(beside)]
    assert np.count_nonzero(expected > own) > 5
    np.testing.assert_allclose(face_bends(jumps, topology), expected, rtol=1e-12)


def test_a_flat_sheet_stays_shut_up_to_its_boundary():
    points, faces = grid(6)
    level = control_level(points, build_topology(faces, len(points)))
    assert not face_bends(level.rings.edge_jumps, level.topology).any()


def test_side_gates_leave_edges_without_a_frame_shut():
    """What a network says there would turn neither with the mesh nor with its numbering."""
    points, faces = folded_sheet()
    level = control_level(points, build_topology(faces, len(points)))
    scheme = pns(scale_free_model(0, side_gates=True))
    placed = scheme.edge_rule(level)
    assert placed.degenerate.sum() == 12
    assert not placed.gate[placed.degenerate].any()
    turn = rotation(np.random.default_rng(0))
    turned = scheme.edge_rule(control_level(points @ turn.T, level.topology))
    np.testing.assert_allclose(turned.positions, placed.positions @ turn.T, atol=1e-6)


def sheet(rows, columns):
    """An arc drawn along a line, as plane quads, each cut in two."""
    number = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, -1)
    u, v = np.divmod(number.ravel(), columns + 1)
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    a, b, c, d = (corner.ravel() for corner in corners)
    points = np.stack([np.cos(0.3 * u), v.astype(float), np.sin(0.3 * u)], axis=1)
    return points, np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])


def both_gates(points, faces):
    """The prior alone on a mesh, with gates that read sides and with gates that do not."""
    models = (with_card(PRIOR_ALONE, **OPEN_GATES, side_gates=sides) for sides in (True, None))
    return [refine(Mesh(points, faces), pns(model)).mesh.vertices for model in models]


def prism(sides):
    """A regular prism: two rings of vertices, then the lids' middles."""
    angle, j = 2 * np.pi * np.arange(sides) / sides, np.arange(sides)
    ring, after = np.stack([np.cos(angle), np.sin(angle)], axis=1), (j + 1) % sides
    low, high, middle = np.c_[ring, 0 * angle], np.c_[ring, 0 * angle + 2], 2 * sides + 0 * j
    walls = [np.c_[j, after, after + sides], np.c_[j, after + sides, j + sides]]
    lids = [np.c_[after, j, middle], np.c_[j + sides, after + sides, middle + 1]]
    points = np.concatenate([low, high, [[0, 0, 0], [0, 0, 2]]])
    return points, np.concatenate(walls + lids)


def box_of_quads(side):
    """A cube with so many quads along each edge, each cut in two."""
    line = np.arange(side + 1)
    u, v = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    flat, zero, full = np.arange(len(u)).reshape(side + 1, -1), 0 * u, 0 * u + side
    corners = flat[:-1, :-1], flat[1:, :-1], flat[1:, 1:], flat[:-1, 1:]
    quads = np.stack([corner.ravel() for corner in corners], axis=1)
    sheets, faces = [], []
    for columns in ((u, v, full), (v, full, u), (full, u, v)):
        sheets.append(np.stack(columns, axis=1))
        faces.append(quads)
    for columns in ((u, v, zero), (v, zero, u), (zero, u, v)):
        sheets.append(np.stack(columns, axis=1))
        faces.append(quads[:, ::-1])
    points = np.concatenate(sheets).astype(float)
    every = np.concatenate([sheet + k * len(u) for k, sheet in enumerate(faces)])
    points, number = np.unique(points, axis=0, return_inverse=True)
    return points, number.reshape(-1)[every][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
