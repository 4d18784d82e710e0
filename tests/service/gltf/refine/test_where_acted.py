"""Ratio and gate of the last learned level are carried to the vertices of later levels."""

import numpy as np
import pytest

from pns_common import load_model
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.networks import random_model

MODEL = load_model()


def corners(name, levels, *meshes, model=MODEL, **options):
    """An attribute at the corners of all faces of a file's first mesh."""
    options = Options(levels=levels, **{"diagnostics": "full", "polygons": "off", **options})
    made = subdivide_gltf(files.glb(*meshes), "glb", options, model, Limits())
    faces, attributes = files.primitive_of(made.glb)
    return attributes[name][faces]


def halved(values):
    """Values at the corners of faces, at those of their children: each new one is a mean."""
    a, b, c = values[:, 0], values[:, 1], values[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    children = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    return np.moveaxis(np.array(children), 2, 0).reshape(-1, 3, *values.shape[2:])


@pytest.mark.parametrize("name", ["_PNS_RATIO", "_PNS_GATE"])
@pytest.mark.parametrize("meshes", [[[octahedron()]], [[octahedron()], [box()]]])
@pytest.mark.parametrize("crease", ["off", "angle:60"])
def test_later_levels_show_the_last_learned_one(name, meshes, crease):
    learned = corners(name, 1, *meshes, crease=crease)
    assert learned.any() == (crease == "off")
    np.testing.assert_allclose(
        corners(name, 3, *meshes, crease=crease, limit=True), halved(halved(learned)), atol=1e-7
    )


def test_learned_levels_show_themselves():
    first, second = (
        corners("_PNS_RATIO", levels, [octahedron()], model=random_model(0)) for levels in (1, 2)
    )
    assert not np.allclose(second, halved(first), atol=1e-3)


def test_the_surface_does_not_depend_on_what_is_shown():
    for shape in ([octahedron()], [box()]):
        shown = corners("POSITION", 2, shape)
        np.testing.assert_array_equal(shown, corners("POSITION", 2, shape, diagnostics="none"))
