"""The table of real meshes: what stands beside the methods."""

import numpy as np

from pns_common import loop
from train.data.primitives import icosphere
from train.experiments.beyond.real_meshes import on_surface
from train.experiments.harness.contenders import LOOP, contenders
from train.metrics.surface_distance import face_tree
from train.refining import refine


def test_vertices_on_the_surface_lie_there_and_faces_stay():
    coarse, sphere = icosphere(1), icosphere(5)
    shrunk = refine(coarse, loop(), 1).mesh
    laid = on_surface(shrunk, face_tree(sphere))
    np.testing.assert_array_equal(laid.faces, shrunk.faces)
    radius = np.linalg.norm(laid.vertices, axis=1)
    assert (
        np.abs(radius - 1).max() < 2e-3 < np.abs(np.linalg.norm(shrunk.vertices, axis=1) - 1).max()
    )


def test_every_contender_refines_to_the_faces_of_loop():
    """What is prepared for one of them serves all."""
    coarse = icosphere(1)
    faces = {name: refine(coarse, scheme, 2).mesh.faces for name, scheme in contenders().items()}
    for own in faces.values():
        np.testing.assert_array_equal(own, faces[LOOP])
