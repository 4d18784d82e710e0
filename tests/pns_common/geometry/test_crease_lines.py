"""Crease lines: what is sharp stays, what is round does not, whatever stands for it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.geometry.crease_lines import (
    CREASE_ANGLE,
    EDGED_ANGLE,
    ROUNDS,
    edges_beyond,
    is_edged,
    line_rows,
    with_crease_lines,
)
from pns_common.geometry.frames import face_normals
from tests.support.meshes import block, bumpy_sphere, grid, manifolds, prism, rotation, soups
from train.data.primitives import box, cone, cylinder, globe, icosphere, l_block, tetrahedron, torus

SHARP_ALONE = Creases(line_angle=CREASE_ANGLE)
WITH_GENTLE = Creases(line_angle=CREASE_ANGLE, edged_angle=EDGED_ANGLE)
ROUND = {
    "tetrahedron": tetrahedron(),
    "octahedron": globe(4, 1),
    "icosahedron": icosphere(0),
    "icosphere": icosphere(2),
    "globe": globe(20, 9),
    "tube of eight sides": torus(12, 8),
    "tube of six sides": torus(12, 6),
    "bumpy sphere": Mesh(*bumpy_sphere()),
    "flat": Mesh(*grid(5)),
    "waves": Mesh(*grid(12, lambda x, y: 0.2 * np.sin(4 * x) * np.cos(3 * y))),
}
# Each with how many of its edges are of lines.
SHARP = {
    "box": (box(), 12),
    "thin box": (box(4, 2, 0.1), 12),
    "L block": (l_block(), 22),
    "cylinder of six sides": (cylinder(6), 12),
    "cylinder of 16 sides": (cylinder(16, rows=6), 32),
    "prism of five sides": (cylinder(5), 15),
    "cone": (cone(16), 16),
    "block": (Mesh(*block(4)), 48),
    "block without a lid": (Mesh(*block(4, closed=False)), 32),
    "noisy block": (Mesh(*block(4, noise=0.02)), 48),
}


def lines(mesh, creases=SHARP_ALONE):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = line_rows(mesh.vertices, normals_of(mesh), topology, creases)
    return {tuple(pair) for pair in topology.edges[rows]}


def normals_of(mesh):
    return face_normals(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("creases", [SHARP_ALONE, WITH_GENTLE])
@pytest.mark.parametrize("name", ROUND)
def test_what_may_stand_for_a_round_shape_has_no_lines(name, creases):
    assert lines(ROUND[name], creases) == set()


@pytest.mark.parametrize("name", SHARP)
def test_edges_between_flat_sides_are_lines(name):
    mesh, count = SHARP[name]
    assert len(lines(mesh)) == count


# All turns beyond 66 degrees but at the two edges of the chamfer, which turn by 45.
CHAMFERED = prism([[0, 0], [2, 0], [2, 1.5], [1.5, 2], [0, 2]])
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
    mesh = Mesh(points, np.concatenate([*walls, fan[:, ::-1], fan + n * rows]))
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


def test_a_mesh_is_edged_where_half_of_its_turns_are_sharp():
    assert is_edged(1, 2)
    assert not is_edged(1, 3)
    assert not is_edged(0, 0)
    # What is known of the whole is not asked of a piece of it.
    for edged, count in ((True, 15), (False, 13)):
        assert len(lines(CHAMFERED, replace(WITH_GENTLE, edged=edged))) == count
    for edged, count in ((True, 4), (None, 0), (False, 0)):
        assert len(lines(pleat(30), replace(WITH_GENTLE, edged=edged))) == count


def fold(sign):
    """A narrow sheet, folded along its middle: by 80 degrees half way, by 30 at its ends."""
    points, faces = grid(17)
    x, y = points[:, 0], points[:, 1] / 20
    half = np.radians(np.clip(75 - 100 * np.abs(x), 15, 40))
    folded = np.stack([x, y * np.cos(half), -sign * np.abs(y) * np.sin(half)], axis=1)
    return Mesh(folded, faces)


def test_sharp_hollows_of_edged_meshes_go_on_among_sharp_edges_alone():
    """Where a limb meets a body they do not, and the rim there would fold into it."""
    edged = replace(WITH_GENTLE, edged=True)
    assert len(lines(fold(1.0), edged)) == 16
    assert len(lines(fold(-1.0), edged)) < 8
    assert len(lines(fold(-1.0))) == len(lines(fold(1.0))) == 0
    # Hollows that do are lines as ever.
    assert len(lines(l_block(), edged)) == 22


def with_face_without_area(mesh, a, b):
    """Put a vertex in the middle of an edge of one of its faces, and a face that closes the gap."""
    faces, middle = mesh.faces.tolist(), len(mesh.vertices)
    first = next(face for face in faces if {a, b} <= {*face})
    at = next(k for k in range(3) if {first[k], first[k - 2]} == {a, b})
    start, end, apart = first[at], first[at - 2], first[at - 1]
    faces.remove(first)
    faces += [[start, middle, apart], [middle, end, apart], [start, end, middle]]
    points = np.concatenate([mesh.vertices, [(mesh.vertices[a] + mesh.vertices[b]) / 2]])
    return Mesh(points, np.array(faces))


@pytest.mark.parametrize("creases", [SHARP_ALONE, WITH_GENTLE])
def test_a_face_without_area_takes_no_lines_but_that_which_it_lies_on(creases):
    """One that closes a gap along an edge turns nowhere, and lines may end there."""
    cube = box()
    sharp = lines(cube, creases)
    every = build_topology(cube.faces, len(cube.vertices)).edges
    for a, b in every.tolist():
        found = lines(with_face_without_area(cube, a, b), creases)
        assert found == sharp - {(a, b)}
    slivered = cube
    for a, b in every.tolist():
        if (a, b) not in sharp:
            slivered = with_face_without_area(slivered, a, b)
    assert lines(slivered, creases) == sharp


@pytest.mark.parametrize("sides", [17, 18])
def test_no_tube_s_walls_turn_by_the_angle_itself_however_they_lie(sides):
    """Else rounding would decide of how many turns a mesh has, and whether it is edged."""
    tube, rng = cylinder(sides), np.random.default_rng(0)
    topology = build_topology(tube.faces, len(tube.vertices))
    cosine = np.cos(np.radians(EDGED_ANGLE))
    walls = sides if sides < 18 else 0
    for _ in range(20):
        normals = face_normals(tube.vertices @ rotation(rng).T, tube.faces)
        bent = edges_beyond(normals, topology, topology.interior, cosine)
        assert len(bent) == 2 * sides + walls


def pleat(degrees):
    """A sheet of four by four cells, folded once along its middle row."""
    points, faces = grid(5)
    half, y = np.radians(degrees) / 2, points[:, 1]
    folded = np.stack([points[:, 0], y * np.cos(half), -np.abs(y) * np.sin(half)], axis=1)
    return Mesh(folded, faces)


@given(
    manifolds() | soups() | st.sampled_from([mesh for mesh, _ in SHARP.values()] + [CHAMFERED]),
    st.integers(0, 99),
    st.floats(0.01, 100),
    st.booleans(),
)
def test_lines_do_not_depend_on_where_a_mesh_lies_nor_on_its_numbers(mesh, seed, scale, mirrored):
    rng = np.random.default_rng(seed)
    turned = scale * (mesh.vertices @ rotation(rng).T) + rng.standard_normal(3)
    faces = mesh.faces
    if mirrored:
        turned, faces = turned * [1, 1, -1], faces[:, ::-1]
    order = rng.permutation(len(turned))
    moved = np.empty_like(turned)
    moved[order] = turned
    renumbered = Mesh(moved, np.roll(order[faces][rng.permutation(len(faces))], seed % 3, axis=1))
    for creases in (SHARP_ALONE, WITH_GENTLE):
        expected = {tuple(sorted(order[list(pair)])) for pair in lines(mesh, creases)}
        assert lines(renumbered, creases) == expected


def folded_sheet(length, loose):
    """A sheet, folded by a right angle along its middle row up to ``loose`` cells from its end."""
    points, faces = grid(2 * length + 1)
    points = points * [length, 1, 1]  # a narrow one: the fold runs along x at y = 0
    opening = np.clip((length - loose - points[:, 0]) / 2, 0, 1)
    half = np.pi / 4 * opening
    y, up = np.abs(points[:, 1]), np.sign(points[:, 1])
    points = np.stack([points[:, 0], up * y * np.cos(half), -y * np.sin(half)], axis=1)
    return Mesh(points, faces)


@pytest.mark.parametrize("loose", [4, 6, 8])
def test_a_line_that_ends_in_a_smooth_surface_loses_as_many_edges_as_there_are_rounds(loose):
    mesh = folded_sheet(12, loose)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    sharp = edges_beyond(normals_of(mesh), topology, topology.interior, np.cos(np.radians(66)))
    on_fold = np.abs(mesh.vertices[:, 1]) < 1e-12
    folds = sharp[on_fold[topology.edges[sharp]].all(axis=1)]
    assert len(folds) > ROUNDS
    assert len(lines(mesh)) == len(folds) - ROUNDS


def test_a_line_from_boundary_to_boundary_loses_none():
    assert len(lines(folded_sheet(6, loose=-6))) == 12


def test_an_edge_is_beyond_an_angle_where_both_faces_have_a_normal():
    cube = box()
    topology = build_topology(cube.faces, 8)
    for degrees, count in ((89.9, 12), (90.1, 0)):
        cosine = np.cos(np.radians(degrees))
        assert len(edges_beyond(normals_of(cube), topology, topology.interior, cosine)) == count
    flat = face_normals(cube.vertices * [1, 1, 0], cube.faces)
    assert len(edges_beyond(flat, topology, topology.interior, 2.0)) < 18


def test_lines_become_creases_beside_those_that_are_there():
    mesh = box()
    plain = build_topology(mesh.faces, 8)
    creased = with_crease_lines(plain, mesh.vertices, normals_of(mesh), SHARP_ALONE)
    assert (creased.edge_class == EdgeClass.CREASE).sum() == 12
    assert len(creased.interior) == 6
    assert with_crease_lines(plain, mesh.vertices, normals_of(mesh), Creases()) is plain
