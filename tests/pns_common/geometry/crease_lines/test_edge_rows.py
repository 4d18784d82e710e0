"""Rows: chamfers and plates stand alone, tubes and arcs do not."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.crease_lines import CHAMFERED, WITH_GENTLE, lines
from tests.support.meshes import prism, rotation
from train.data.primitives import cone, cylinder, l_block

# Plates of a hull: turns of 20 to 50 degrees between plane faces of any width.
HULL = prism([[0, 0], [3, 0], [4.5, 0.9], [4.9, 2], [3, 3.1], [1.2, 3.3], [0, 2]])


@pytest.mark.parametrize(
    ("mesh", "sharp", "all_of_them"),
    [
        (CHAMFERED, 13, 15),
        (HULL, 16, 21),
        (cylinder(6), 12, 18),
        *((cylinder(sides), 2 * sides, 2 * sides) for sides in (7, 8, 12, 16)),
        (cylinder(8, rows=3), 16, 16),
        (cone(16), 16, 16),
        (l_block(), 22, 22),
    ],
)
def test_edged_meshes_keep_gentler_edges_that_stand_alone(mesh, sharp, all_of_them):
    assert len(lines(mesh)) == sharp
    assert len(lines(mesh, WITH_GENTLE)) == all_of_them


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_an_edge_is_not_beside_one_that_goes_on_from_it(rows):
    """However a chamfer's walls are cut: some have the next edge of the line in the next face."""
    profile = np.array([[0, 0], [2, 0], [2, 1.5], [1.5, 2], [0, 2]])
    n, k, after = 5, np.arange(5), (np.arange(5) + 1) % 5
    points = np.concatenate([np.c_[profile, np.full(n, height)] for height in range(rows + 1)])
    walls = []
    for row in range(rows):
        a, b, c, d = k, after, n + after, n + k
        cut = [np.c_[a, b, c], np.c_[a, c, d]] if row % 2 else [np.c_[a, b, d], np.c_[b, c, d]]
        walls += [faces + n * row for faces in cut]
    fan = np.stack([0 * k[2:], k[1:-1], k[2:]], axis=1)
    faces = np.concatenate([*walls, fan[:, ::-1], fan + n * rows])
    for order in (np.arange(len(points)), np.random.default_rng(0).permutation(len(points))):
        mesh = Mesh(points[np.argsort(order)], order[faces])
        assert len(lines(mesh)) == 2 * n + 3 * rows
        assert len(lines(mesh, WITH_GENTLE)) == 2 * n + 5 * rows


@pytest.mark.parametrize("pieces", [2, 3, 4])
def test_fillets_of_three_pieces_or_more_stay_round(pieces):
    """An arc from one flat side to the next, of which a piece turns into a side by half as much."""
    angles = np.radians(np.linspace(0, 90, pieces + 1)) + np.radians([[0], [90], [180], [270]])
    centres = np.array([[2, 1], [-2, 1], [-2, -1], [2, -1]])
    arcs = centres[:, None] + np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    profile = arcs.reshape(-1, 2)
    rims = 2 * len(profile)
    # Where an arc of two pieces meets its sides it turns by more than 21 degrees.
    at_ends = 8 if pieces == 2 else 0
    assert len(lines(prism(profile), WITH_GENTLE)) == rims + at_ends


@pytest.mark.parametrize("pieces", [4, 6, 8])
def test_an_arc_stays_round_up_to_the_sharp_edge_where_it_ends(pieces):
    angles = np.linspace(0, np.pi, pieces + 1)
    profile = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    assert len(lines(prism(profile), WITH_GENTLE)) == 2 * len(profile) + 2


def test_walls_of_eleven_beside_those_of_ten_end_a_row_however_they_lie():
    """Else rounding would decide where an arc whose last walls are a little wider ends."""
    widths, angles = np.array([11, 10, 10, 10, 10, 11]), np.radians(np.arange(15, 180, 30))
    walls = widths * [np.cos(angles), np.sin(angles)]
    arc, rng = prism(np.concatenate([[[0, 0]], walls.T.cumsum(axis=0)])), np.random.default_rng(0)
    for _ in range(20):
        turned = Mesh(arc.vertices @ rotation(rng).T, arc.faces)
        assert len(lines(turned, WITH_GENTLE)) == 2 * 7 + 2


@pytest.mark.parametrize(("ratio", "is_bar"), [(1, False), (4, False), (4.1, True), (10, True)])
def test_a_bar_with_four_chamfers_is_no_tube(ratio, is_bar):
    """Each edge is beside one like it on both sides; but the walls are so many times as wide."""
    cut, half = 1 / np.sqrt(2), ratio / 2 + 1 / np.sqrt(2)
    corner = np.array([[half, half - cut], [half - cut, half]])
    profile = np.concatenate([corner @ rotation_by(k).T for k in range(4)])
    rims = 2 * len(profile)
    assert len(lines(prism(profile), WITH_GENTLE)) == rims + 8 * is_bar


def rotation_by(quarters):
    """So many quarter turns of the plane."""
    return np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), quarters)


def folds(turns):
    """Return which folds of a sheet, which is edged, are lines.

    Its walls are as wide as one another, and turn one after the other by so many degrees.
    """
    at = np.radians(np.cumsum([0, *turns]))
    profile = np.concatenate([[[0, 0]], np.stack([np.cos(at), np.sin(at)], axis=1).cumsum(axis=0)])
    n = len(profile)
    points = np.concatenate([np.c_[profile, np.zeros(n)], np.c_[profile, np.full(n, 2.0)]])
    a = np.arange(n - 1)
    mesh = Mesh(points, np.concatenate([np.c_[a, a + 1, a + n + 1], np.c_[a, a + n + 1, a + n]]))
    found = lines(mesh, replace(WITH_GENTLE, edged=True))
    return [(k, k + n) in found for k in range(1, n - 1)]


def degrees_of(times, degrees):
    """The turn whose 1 − cos t is so many times that of another."""
    return np.degrees(np.arccos(1 - times * (1 - np.cos(np.radians(degrees)))))


@pytest.mark.parametrize(
    ("turn", "beside", "is_alone"),
    [
        (54, 54, False),
        (56, 56, True),
        (22, degrees_of(2.9, 22), False),
        (22, degrees_of(3.1, 22), True),
        (45, degrees_of(1 / 3.9, 45), False),
        (45, degrees_of(1 / 4.1, 45), True),
        (40, -40, True),
    ],
)
def test_an_edge_is_in_a_row_with_such_as_turn_like_it_the_same_way(turn, beside, is_alone):
    assert folds([90, beside, turn, beside, 90])[2] == is_alone
    assert folds([-90, -beside, -turn, -beside, -90])[2] == is_alone


@pytest.mark.parametrize(("lean", "is_alone"), [(25, False), (29, True)])
def test_edges_in_a_row_run_within_20_degrees_of_parallel(lean, is_alone):
    """Those of eight sides of a pyramid without its tip: they are 18.6 and 21.4 degrees apart."""
    tube = cylinder(8, height=1.0)
    taper = 1 - tube.vertices[:, 2:] * np.tan(np.radians(lean))
    mesh = Mesh(tube.vertices * np.c_[taper, taper, 0 * taper + 1], tube.faces)
    assert len(lines(mesh, replace(WITH_GENTLE, edged=True))) == 16 + 8 * is_alone


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("sharp", [-75, 75])
def test_a_row_ends_at_a_sharper_edge_whichever_way_that_turns(side, sharp):
    found = folds([side * turn for turn in (sharp, 30, 30, 30, sharp)])
    assert found == [True, False, False, False, True]


def test_there_is_nothing_across_the_edge_of_a_sheet():
    """Of two sheets, each folded once, the one is not beside the other's fold."""
    up = np.sin(np.radians(15))
    sheet = np.array([[-1, 0, 0], [-1, 3, 0], [0, 0, up], [0, 3, up], [1, 0, 0], [1, 3, 0]])
    faces = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    mesh = Mesh(
        np.concatenate([sheet, sheet + np.array([9, 0, 0])]), np.concatenate([faces, faces + 6])
    )
    assert lines(mesh, replace(WITH_GENTLE, edged=True)) == {(2, 3), (8, 9)}


def test_edges_of_a_rim_of_36_sides_are_in_no_row_however_it_is_turned():
    """Two of them run at 20 degrees, across the flat side that they are edges of."""
    mesh, edged = chamfered_shaft(36), replace(WITH_GENTLE, edged=True)
    for seed in range(6):
        turned = Mesh(mesh.vertices @ rotation(np.random.default_rng(seed)).T, mesh.faces)
        assert len(lines(turned, edged)) == 3 * 36


def chamfered_shaft(sides):
    """A cylinder with a chamfer below; each of its flat sides is a fan from one corner."""
    angle = np.arange(sides) * 2 * np.pi / sides
    rings = [[r * np.cos(angle), r * np.sin(angle), 0 * angle + z] for r, z in RINGS]
    here, after = np.arange(sides), np.roll(np.arange(sides), -1)
    faces = [np.stack([0 * here[2:], here[2:], here[1:-1]], axis=1)]
    for ring in range(2):
        a, b = here + ring * sides, after + ring * sides
        faces += [np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)]
    faces.append(2 * sides + faces[0][:, [0, 2, 1]])
    return Mesh(np.concatenate([np.stack(ring, axis=1) for ring in rings]), np.concatenate(faces))


# Radius and height.
RINGS = (0.95, 0.0), (1.0, 0.05), (1.0, 2.0)
