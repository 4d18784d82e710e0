"""`subdivide` gives back the kind of mesh that it was given, made by the same library."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from pns_common import Creases, Mesh, ParameterError, load_model, pns, refine, subdivide
from tests.support.polygons import CUBE, CUBE_FACES
from tests.support.split_data import FACES, SCHEME, VERTICES, same_surface


def test_a_mesh():
    refined = subdivide(Mesh(VERTICES, FACES), 2, SCHEME)
    assert isinstance(refined, Mesh)
    same_surface(refined.vertices, refined.faces)


class Surface(NamedTuple):
    vertices: Any
    faces: Any


@pytest.mark.parametrize("given", [(VERTICES, FACES), [VERTICES, FACES], Surface(VERTICES, FACES)])
def test_a_pair_of_arrays(given):
    refined = subdivide(given, 2, SCHEME)
    assert type(refined) is type(given)
    same_surface(*refined)
    refined[0][0] = 0  # the caller's own


def test_the_scheme_is_the_default_model_where_none_is_given():
    vertices, _ = subdivide((VERTICES, FACES), reference_length=1)
    expected = refine(Mesh(VERTICES, FACES), pns(load_model()), reference_length=1)
    np.testing.assert_array_equal(vertices, expected.mesh.vertices)


@pytest.mark.parametrize("mesh", [None, "part.glb", (VERTICES, FACES, FACES), VERTICES])
def test_other_things_are_refused_with_the_kinds_that_there_are(mesh):
    with pytest.raises(ParameterError, match=r"trimesh\.Trimesh.*pyvista\.MultiBlock"):
        subdivide(mesh)


def test_polygons_are_cut_where_that_is_asked_for():
    square, cut = [[3, 2, 1, 0]], [[3, 2, 1], [3, 1, 0]]
    expected = refine(Mesh(np.eye(4, 3), cut), SCHEME, 1).mesh
    vertices, faces = subdivide((np.eye(4, 3), square), 1, SCHEME, triangulate=True)
    np.testing.assert_array_equal(vertices, expected.vertices)
    np.testing.assert_array_equal(faces, expected.faces)
    made = subdivide(Mesh(np.eye(4, 3), square), 1, SCHEME, triangulate=True)
    np.testing.assert_array_equal(made.vertices, expected.vertices)


@pytest.mark.parametrize("name", ["crease", "creases"])
def test_creases_are_named_as_on_the_command_line(name):
    cube = Mesh(CUBE, CUBE_FACES).triangulated()
    off = refine(cube, "loop", 2, creases=None).mesh.vertices
    angle = refine(cube, "loop", 2, creases=Creases(angle=40)).mesh.vertices
    assert (off != angle).any()
    for word, expected in {"off": off, "auto": off, "angle:40": angle, "angle:40.0": angle}.items():
        for made in (
            refine(cube, "loop", 2, **{name: word}).mesh,
            subdivide(cube, 2, "loop", **{name: word}),
        ):
            np.testing.assert_array_equal(made.vertices, expected)
    pairs = np.array([[0, 1]])
    sharp = refine(cube, "loop", 2, **{name: pairs}).mesh.vertices
    assert (sharp != off).any()
    np.testing.assert_array_equal(refine(cube, "loop", 2, **{name: None}).mesh.vertices, off)
    for word in ("none", "angle:", "angle:-3", "angle:180", "normals"):
        with pytest.raises(ParameterError):
            refine(cube, "loop", 2, **{name: word})
    with pytest.raises(ParameterError, match="crease = "):
        refine(cube, "loop", 2, creases="off", crease="angle:30")


@pytest.mark.parametrize(
    ("wrong", "right"), [("level", "levels"), ("sharp_creases", "creases"), ("thread", "threads")]
)
def test_a_wrong_name_of_an_option_tells_the_right_one(wrong, right):
    with pytest.raises(TypeError, match=f"no option '{wrong}': {right} is meant"):
        subdivide((VERTICES, FACES), 1, SCHEME, **{wrong: 1})
    with pytest.raises(TypeError, match="there are weld, reference_length"):
        subdivide((VERTICES, FACES), 1, SCHEME, zzz=1)
