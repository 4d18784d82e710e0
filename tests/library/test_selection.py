"""Some faces refined alone: where they would be, nothing cracked, all else where it was."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pns_common import Mesh, ParameterError, load_model, loop, pns, subdivide
from pns_common.mesh.topology import EdgeClass
from tests.support.control_points import refine
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, soups
from tests.support.polygons import SHAPES, polygon_manifolds, quad_grid, uneven


def sides(faces):
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return {tuple(pair) for pair in pairs.tolist()}


@pytest.mark.parametrize("scheme", [loop(), pns(load_model())], ids=["loop", "pns"])
@pytest.mark.parametrize("levels", [1, 3])
def test_a_closed_mesh_stays_closed_and_chosen_faces_are_as_if_all_were(levels, scheme):
    points, faces = bumpy_sphere()
    whole = refine(Mesh(points, faces), scheme, levels)
    for share in (0.05, 0.3, 0.6, 0.9):
        chosen = np.random.default_rng(levels).random(len(faces)) < share
        part = refine(Mesh(points, faces), scheme, levels, faces=chosen)
        there = sides(part.mesh.faces)
        assert len(there) == part.mesh.faces.size
        assert there == {(b, a) for a, b in there}
        assert len(part.mesh.vertices) - part.mesh.faces.size // 6 == 2
        full = whole.mesh.faces.reshape(len(faces), -1, 3)[chosen].reshape(-1, 3)
        wanted = {tuple(map(tuple, t)) for t in whole.mesh.vertices[full].tolist()}
        assert wanted <= {
            tuple(map(tuple, t)) for t in part.mesh.vertices[part.mesh.faces].tolist()
        }
        away = np.setdiff1d(np.arange(len(points)), faces[chosen])
        np.testing.assert_array_equal(part.mesh.vertices[away], points[away])


def uses(mesh):
    """Count how often each directed side of a mesh's faces occurs."""
    rings = [face.tolist() for face in mesh.polygons]
    return Counter(side for face in rings for side in zip(face, face[1:] + face[:1], strict=True))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("limit", [False, True])
def test_polygons_beside_chosen_ones_meet_them(name, levels, limit):
    """No side is open that was not, and no new vertex lies on a side without being its end."""
    points, faces = SHAPES[name]
    mesh, scheme = Mesh(uneven(points), faces), pns(load_model()).for_polygons()
    whole = refine(mesh, scheme, levels, limit=limit).mesh
    edges = mesh.topology()
    for share in (0.2, 0.5, 0.8):
        chosen = np.random.default_rng(levels).random(mesh.face_count) < share
        chosen[0] = True
        part = refine(mesh, scheme, levels, faces=chosen, limit=limit)
        sides = uses(part.mesh)
        assert set(sides.values()) == {1}
        opened = {side for side in sides if side[::-1] not in sides}
        of = np.repeat(np.arange(mesh.face_count), np.diff(mesh.offsets))
        lengths = np.zeros(len(edges.edges), dtype=int)
        np.maximum.at(lengths, edges.corner_edges, np.where(chosen[of], 2**levels, 1))
        assert len(opened) == lengths[edges.edge_class == EdgeClass.BOUNDARY].sum()
        before = len(mesh.vertices) - len(edges.edges) + mesh.face_count
        assert (
            len(part.mesh.vertices) - (len(sides) + len(opened)) // 2 + part.mesh.face_count
            == before
        )
        # Chosen faces are as if all were refined; others have their corners, in their order.
        full = whole.faces.reshape(-1, 4)[np.repeat(chosen[of], 4 ** (levels - 1))]
        polygons = iter(part.mesh.polygons)
        quads = iter(whole.vertices[full])
        for face, is_chosen in zip(mesh.polygons, chosen, strict=True):
            if is_chosen:
                for _ in range(len(face) * 4 ** (levels - 1)):
                    np.testing.assert_array_equal(part.mesh.vertices[next(polygons)], next(quads))
            else:
                ring = next(polygons)
                assert ring[ring < len(mesh.vertices)].tolist() == face.tolist()
        assert next(polygons, None) is None
        away = np.setdiff1d(np.arange(len(points)), mesh.corners[chosen[of]])
        np.testing.assert_array_equal(part.mesh.vertices[away], mesh.vertices[away])
    every = refine(mesh, scheme, levels, faces=np.ones(mesh.face_count, bool), limit=limit)
    np.testing.assert_array_equal(every.mesh.vertices, whole.vertices)
    np.testing.assert_array_equal(every.mesh.faces, whole.faces)


@pytest.mark.parametrize("levels", [1, 2])
def test_a_flat_mesh_keeps_its_area_and_a_box_its_volume(levels):
    points, faces = quad_grid(5)
    chosen = [5, 6, 9]
    flat = refine(Mesh(points, faces), "catmull-clark", levels, faces=chosen, border="fixed").mesh
    assert newell(flat)[2] == pytest.approx(2 * 4)
    edges = Mesh(*SHAPES["cube"]).topology().edges.astype(int)
    box = refine(Mesh(*SHAPES["cube"]), "catmull-clark", levels, faces=[2], creases=edges).mesh
    cut = box.triangulated()
    assert np.linalg.det(cut.vertices[cut.faces]).sum() / 6 == pytest.approx(1)


def newell(mesh):
    """Twice the area vector of all faces together."""
    sums = [
        np.cross(mesh.vertices[f], np.roll(mesh.vertices[f], -1, axis=0)) for f in mesh.polygons
    ]
    return sum(each.sum(axis=0) for each in sums)


@pytest.mark.parametrize("scheme", ["loop", "catmull-clark"])
@given(manifolds() | polygon_manifolds() | soups(), st.integers(0, 2**31), st.integers(1, 2))
def test_parents_are_those_of_what_is_left(scheme, mesh, seed, levels):
    assume(scheme != "loop" or mesh.triangles)
    chosen = np.random.default_rng(seed).random(mesh.face_count) < 0.5
    chosen[0] = True
    made = refine(mesh, scheme, levels, faces=np.flatnonzero(chosen))
    matrix = made.parents
    again = np.zeros_like(made.mesh.vertices)
    np.add.at(again, matrix.rows, matrix.weights[:, None] * mesh.vertices[matrix.columns])
    size = np.abs(mesh.vertices).max()
    np.testing.assert_allclose(again, made.mesh.vertices, rtol=0, atol=1e-13 * size)
    assert set(made.mesh.corners.tolist()) >= {*range(len(mesh.vertices), len(again))}


def test_arrays_of_polygons_come_back_as_a_list():
    vertices, faces = subdivide(SHAPES["cube"], 1, "catmull-clark", faces=[0])
    assert sorted(map(len, faces)) == [4] * 5 + [5] * 4
    assert Mesh(vertices, faces).face_count == 9


@pytest.mark.parametrize("faces", [[], [99], [-1], [0.5], np.zeros(32, dtype=bool), [[0]]])
def test_faces_that_are_none_are_refused(faces):
    with pytest.raises(ParameterError) as raised:
        refine(Mesh(*grid(4, bent)), loop(), 1, faces=np.array(faces))
    assert raised.value.name == "faces"
