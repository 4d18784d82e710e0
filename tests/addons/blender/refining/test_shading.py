"""Shading of a result: found edges are sharp, faces smooth, normals those of the surface."""

from dataclasses import replace

import numpy as np
import pytest

from addons.blender.pns_refine.refining.compute import Choice, compute
from addons.blender.pns_refine.refining.snapshot import Domain, Layer, Rule
from pns_common import Mesh, load_model, loop, refine
from pns_common.model.file import DEFAULT_MODEL
from tests.addons.blender.quads import cube, cut, grid


def named(refined, name):
    return [layer for layer in refined.layers if layer.name == name]


def flags(name, domain, count, value=True):
    return Layer(name, "BOOLEAN", domain, Rule.KEEP, np.full((count, 1), value))


@pytest.mark.parametrize("shape", [cube(), cut(cube())])
def test_edges_of_a_cube_that_the_model_finds_are_marked_sharp(shape):
    flat = flags("sharp_face", Domain.FACE, len(shape.polygon_corners) - 1)
    made = compute(replace(shape, layers=(flat,)), Choice(load_model(DEFAULT_MODEL), 2))
    assert named(made, "sharp_face") == []
    (sharp,) = named(made, "sharp_edge")
    ends = made.points[made.edges[sharp.values[:, 0]]]
    # Twelve edges of the cube in four parts, where two sides meet: the model keeps 99 % of them.
    assert len(ends) == 12 * 4
    assert (np.isclose(np.abs(ends), 1, atol=0.01).all(axis=1).sum(axis=1) == 2).all()
    # The normal of each side at all of its corners, also at the cube's own.
    (normals,) = named(made, "normals")
    assert (np.abs(normals.values).max(axis=1) > 0.99).all()
    starts, sizes = made.faces.starts[:-1], np.diff(made.faces.starts)
    centres = np.add.reduceat(made.points[made.faces.vertices], starts) / sizes[:, None]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    assert (np.einsum("ij,ij->i", normals.values, centres[owner]) > 0.9).all()


def test_a_smooth_surface_has_its_limit_normals_and_no_mark():
    shape = grid(4)
    made = compute(shape, Choice(None, 2))
    assert named(made, "sharp_edge") == []
    (normals,) = named(made, "normals")
    expected = refine(Mesh(shape.points, shape.triangles), loop(), 2, creases=None)
    np.testing.assert_allclose(
        normals.values, expected.normals[made.faces.vertices], rtol=0, atol=1e-9
    )


def test_marks_of_the_mesh_stay_beside_those_that_are_found():
    shape = grid(4)
    own = flags("sharp_edge", Domain.EDGE, len(shape.edges), value=False)
    own.values[:3] = True
    made = compute(replace(shape, layers=(own,)), Choice(None, 1, crease_lines=False))
    (sharp,) = named(made, "sharp_edge")
    assert sharp.values.sum() == 6
    # Creases of the mesh are sharp on its surface.
    creased = compute(cube(np.inf), Choice(None, 1, crease_lines=False))
    assert named(creased, "sharp_edge")[0].values.sum() == 24
    assert (creased.crease_sharpness == np.inf).sum() == 24


def test_flat_faces_that_are_no_edges_stay_flat_among_smooth_ones():
    shape = grid(4)
    some = flags("sharp_face", Domain.FACE, 16, value=False)
    some.values[0] = True
    made = compute(replace(shape, layers=(some,)), Choice(None, 1, crease_lines=False))
    assert named(made, "sharp_face")[0].values.sum() > 0
    # Free normals would hide that they are flat.
    assert named(made, "normals") == []
    off = compute(shape, Choice(None, 1, limit=False))
    assert named(off, "normals") == []
