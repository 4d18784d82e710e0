"""Some faces refined alone: where they would be, nothing cracked, all else where it was."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ParameterError, load_model, loop, pns, refine
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds


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


@given(manifolds(), st.integers(0, 2**31), st.integers(1, 2))
def test_parents_are_those_of_what_is_left(mesh, seed, levels):
    chosen = np.random.default_rng(seed).random(len(mesh.faces)) < 0.5
    chosen[0] = True
    made = refine(mesh, loop(), levels, faces=np.flatnonzero(chosen))
    matrix = made.parents
    again = np.zeros_like(made.mesh.vertices)
    np.add.at(again, matrix.rows, matrix.weights[:, None] * mesh.vertices[matrix.columns])
    np.testing.assert_allclose(again, made.mesh.vertices, atol=1e-13)


@pytest.mark.parametrize("faces", [[], [99], [-1], [0.5], np.zeros(32, dtype=bool), [[0]]])
def test_faces_that_are_none_are_refused(faces):
    with pytest.raises(ParameterError) as raised:
        refine(Mesh(*grid(4, bent)), loop(), 1, faces=np.array(faces))
    assert raised.value.name == "faces"
