"""Lines go on: they end at corners, rims and faces without area, and nowhere else."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import line_rows
from pns_common.geometry.crease_lines.going_on import ROUNDS, go_on
from pns_common.geometry.crease_lines.turns import edges_beyond
from tests.support.crease_lines import SHARP_ALONE, WITH_GENTLE, lines, normals_of
from tests.support.meshes import grid, prism
from train.data.primitives import box


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


@pytest.mark.parametrize(("corners", "is_circle"), [(5, False), (6, True)])
def test_a_rim_of_six_corners_goes_on_and_one_of_five_does_not(corners, is_circle):
    """It turns by 60 degrees at each, or by 72; walls' edges are not asked about."""
    at = 2 * np.pi * np.arange(corners) / corners
    tube = prism(np.stack([np.cos(at), np.sin(at)], axis=1))
    topology = build_topology(tube.faces, len(tube.vertices))
    pairs = np.sort(np.stack([np.arange(corners), np.roll(np.arange(corners), -1)], axis=1), axis=1)
    rim = np.flatnonzero((topology.edges[:, None] == pairs).all(axis=-1).any(axis=1))
    nowhere = np.zeros(len(tube.vertices), dtype=bool)
    on = go_on(tube.vertices, topology, rim, nowhere, np.cos(np.radians(66)))
    assert (len(rim), on.all()) == (corners, is_circle)


def test_a_line_that_ends_at_a_crease_that_is_named_loses_none():
    mesh = folded_sheet(12, loose=6)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    along = 25  # from a vertex to the next one on the fold
    last = max(map(max, lines(mesh))) + ROUNDS * along
    creased = with_creases(topology, np.array([[last, last + 1]]))
    found = line_rows(mesh.vertices, normals_of(mesh), creased, SHARP_ALONE)
    assert len(found) == len(lines(mesh)) + ROUNDS
