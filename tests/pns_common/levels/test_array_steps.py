"""Steps one after the other: each starts where the one before it ended."""

from itertools import islice

import numpy as np

from pns_common import Mesh, loop, pns, refine
from pns_common.base.blocks import WHOLE
from pns_common.connectivity.creases import Creases
from pns_common.connectivity.topology import EdgeClass
from pns_common.levels.array_steps import array_steps
from tests.support.meshes import bow_tie, bumpy_sphere
from tests.support.networks import scale_free_model

POINTS, FACES = bumpy_sphere(2, subdivisions=0)


def steps(scheme, count, points=POINTS, faces=FACES, creases=None):
    return list(islice(array_steps(points, faces, Creases(creases), scheme, 1.0, WHOLE), count))


def test_the_steps_are_refine_of_one_level_again_and_again():
    scheme = pns(scale_free_model(0, learned_levels=2))
    for levels, step in enumerate(steps(scheme, 3), start=1):
        refined = refine(Mesh(POINTS, FACES), scheme, levels, 1.0).mesh
        np.testing.assert_array_equal(step.placed.points, refined.vertices)
        np.testing.assert_array_equal(step.faces, refined.faces)


def test_the_next_step_is_given_the_normals_of_the_children():
    first, second = steps(loop(), 2)
    a, b, c = (first.placed.points[first.faces[:, corner]] for corner in range(3))
    area = np.cross(b - a, c - a)
    expected = area / np.linalg.norm(area, axis=1, keepdims=True)
    np.testing.assert_allclose(first.children.normals, expected, atol=1e-14)
    np.testing.assert_array_equal(second.topology.faces, first.faces)


def test_fans_are_counted_in_the_control_mesh_alone():
    first, second = steps(loop(), 2, *bow_tie())
    assert first.multi_fan_vertices.tolist() == [True, False, False, False, False]
    assert second.multi_fan_vertices is None


def test_creases_are_followed():
    counts = [
        (step.topology.edge_class == EdgeClass.CREASE).sum()
        for step in steps(loop(), 3, creases=FACES[:1, :2])
    ]
    assert counts == [1, 2, 4]
