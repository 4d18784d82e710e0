"""Creases: Hoppe's rules, held against the boundary rules that they equal on each side."""

import numpy as np
import pytest

from pns_common import Creases, Mesh, ParameterError, loop, pns, refine, subdivide
from pns_common.connectivity.creases import as_pairs
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.interop.carried import CarriedMesh, refine_carried
from pns_common.masks.linear import level_topologies
from tests.support.meshes import bent, bumpy_sphere, grid
from tests.support.networks import random_model


def halves():
    """A bumpy sphere, the loop of edges between two parts of it, and the faces of each part."""
    vertices, faces = bumpy_sphere(subdivisions=2)
    upper = vertices[faces].mean(axis=1)[:, 2] > 0.05
    topology = build_topology(faces, len(vertices))
    sides = upper[topology.edge_faces]
    return vertices, faces, topology.edges[sides[:, 0] != sides[:, 1]], upper


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_a_closed_crease_refines_each_side_as_if_it_were_cut_open(levels):
    vertices, faces, rim, upper = halves()
    whole = refine(Mesh(vertices, faces), loop(), levels, creases=rim).mesh
    triangles = whole.vertices[whole.faces].reshape(len(faces), -1, 3)
    for side in (upper, ~upper):
        part = refine(Mesh(vertices, faces[side]), loop(), levels).mesh
        expected = part.vertices[part.faces].reshape(side.sum(), -1, 3)
        np.testing.assert_allclose(triangles[side], expected, atol=1e-14)


@pytest.mark.parametrize(
    ("wrong", "name", "value"),
    [
        ([[0, 1], [1, 2], [3]], "creases[2]", [3]),
        ([[0, [1, 2]], [0, 1]], "creases[0]", [0, [1, 2]]),
        ([[0, 1], 2], "creases[1]", 2),
        ([[0, 1, 2]], "creases.shape", (1, 3)),
        ([0, 1], "creases.shape", (2,)),
        (7, "creases.shape", ()),
        ({(0, 1)}, "creases.shape", ()),
        ([[0.0, 1.0]], "creases.dtype", "float64"),
        ([[0, float("nan")]], "creases.dtype", "float64"),
        ([[0, 2**70]], "creases.dtype", "object"),
        ([["a", "b"]], "creases.dtype", "<U1"),
        ([[True, False]], "creases.dtype", "bool"),
        (np.ma.array([[0, 1]], mask=[[False, True]]), "creases.mask", True),
        ([[0, 1], [-1, 0]], "creases[1]", [-1, 0]),
        ([[0, 1], [0, 9]], "creases[1]", [0, 9]),
        (np.array([[2**64 - 1, 0]], dtype=np.uint64), "creases[0]", [2**64 - 1, 0]),
        ([[0, 1], [8, 0]], "creases[1]", [8, 0]),
        ([[5, 5]], "creases[0]", [5, 5]),
    ],
)
@pytest.mark.parametrize("front_door", ["refine", "Creases", "subdivide", "carried"])
def test_creases_that_are_no_edges_are_told_by_row(front_door, wrong, name, value):
    mesh, carried = Mesh(*grid(3)), CarriedMesh(*grid(3))
    doors = {
        "refine": lambda: refine(mesh, loop(), creases=wrong),
        "Creases": lambda: refine(mesh, loop(), creases=Creases(wrong)),
        "subdivide": lambda: subdivide(mesh, scheme=loop(), creases=wrong),
        "carried": lambda: refine_carried(carried, loop(), 1, {"creases": wrong}),
    }
    # Where annotations are enforced, another kind ends there first.
    with pytest.raises((ParameterError, TypeError)) as caught:
        doors[front_door]()
    if isinstance(caught.value, ParameterError):
        assert (caught.value.name, caught.value.value) == (name, value)


@pytest.mark.parametrize("none", [np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2)), []])
def test_no_pairs_are_no_creases(none):
    assert as_pairs(none).shape == (0, 2)
    assert as_pairs(none).dtype == np.int64


@pytest.mark.parametrize("kind", ["u8", ">i4", "i1", "i8"])
def test_pairs_are_a_signed_copy_of_any_whole_numbers(kind):
    given = np.array([[3, 1], [0, 2]], dtype=kind)
    creases = Creases(as_pairs(given))
    given[:] = 7  # nobody changes them afterwards
    assert creases.named.dtype == np.int64
    assert creases.named.tolist() == [[3, 1], [0, 2]]


def test_pairs_beyond_signed_numbers_are_refused():
    with pytest.raises(ParameterError, match=r"creases\[1\] = \[18446744073709551615, 0\]"):
        as_pairs(np.array([[0, 1], [2**64 - 1, 0]], dtype=np.uint64))


def test_crease_edges_get_no_correction_and_are_counted():
    vertices, faces, rim, _ = halves()
    refined = refine(Mesh(vertices, faces), pns(random_model(0)), 2, creases=rim)
    counts = [level["edges"] for level in refined.report["levels"]]
    assert [count["crease"] for count in counts] == [len(rim), 2 * len(rim)]
    assert sum(counts[0].values()) == 3 * len(faces) // 2
    control, fine = level_topologies(faces, len(vertices), 2, Creases(rim))
    crease = fine.vertex_count + np.flatnonzero(fine.edge_class == EdgeClass.CREASE)
    assert len(crease) == 2 * len(rim)
    assert not refined.ratio[crease].any()
    assert not refined.gate[crease].any()
    # The crease is a curve of its own: its vertices are Loop's on the rim alone.
    by_loop = refine(Mesh(vertices, faces), loop(), 2, creases=rim).mesh.vertices
    np.testing.assert_array_equal(refined.mesh.vertices[crease], by_loop[crease])
    assert control.vertex_count == len(vertices)


def test_without_creases_the_report_has_no_such_class():
    mesh = Mesh(*grid(4, bent))
    assert set(refine(mesh, loop()).report["levels"][0]["edges"]) == {
        "interior",
        "boundary",
        "irregular",
    }
    plain = refine(mesh, loop(), 2).mesh.vertices
    empty = refine(mesh, loop(), 2, creases=np.zeros((0, 2), dtype=np.int64)).mesh.vertices
    np.testing.assert_array_equal(plain, empty)


def test_one_crease_is_a_dart_and_three_make_a_corner():
    vertices, faces = grid(5, bent)
    ring = build_topology(faces, len(vertices)).edges
    at_centre = ring[(ring == 12).any(axis=1)]
    smooth = refine(Mesh(vertices, faces), loop()).mesh.vertices[12]
    for count, expected in ((1, smooth), (3, vertices[12])):
        creases = at_centre[:count]
        refined = refine(Mesh(vertices, faces), loop(), creases=creases).mesh.vertices
        np.testing.assert_allclose(refined[12], expected, atol=1e-15)
        edges = build_topology(faces, len(vertices)).edges
        number = np.flatnonzero((edges == creases[0]).all(axis=1))[0]
        middle = vertices[creases[0]].mean(axis=0)
        np.testing.assert_array_equal(refined[len(vertices) + number], middle)


def test_a_boundary_edge_stays_a_boundary():
    vertices, faces = grid(4, bent)
    topology = build_topology(faces, len(vertices))
    rim = topology.edges[topology.edge_class == EdgeClass.BOUNDARY]
    report = refine(Mesh(vertices, faces), loop(), creases=rim).report
    assert report["levels"][0]["edges"]["boundary"] == len(rim)
