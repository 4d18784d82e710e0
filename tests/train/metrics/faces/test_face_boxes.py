"""The tree of boxes: every face is in it once, and in the box of everything above it."""

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.meshes import bumpy_sphere
from train.metrics.faces.face_boxes import WIDE, face_boxes, moved


@pytest.mark.parametrize("count", [1, 7, 8, 9, 64, 65, 320])
def test_boxes_hold_their_faces_and_the_boxes_below(count):
    vertices, faces = bumpy_sphere(subdivisions=2)
    mesh = Mesh(vertices, faces[:count])
    first = face_boxes(mesh)
    for tree in (first, moved(first, vertices[::-1])):
        np.testing.assert_array_equal(np.sort(tree.order), np.arange(len(mesh.faces)))
        corners = tree.vertices[tree.faces[tree.order]]
        np.testing.assert_array_equal(tree.corners, corners)
        lanes = tree.boxes[tree.last_level :].swapaxes(1, 2).reshape(-1, 6)
        np.testing.assert_array_equal(lanes[: len(corners), :3], corners.min(axis=1))
        np.testing.assert_array_equal(lanes[: len(corners), 3:], corners.max(axis=1))
        assert (lanes[len(corners) :, :3] == np.inf).all()
        for node in range(1, len(tree.boxes)):
            above = tree.boxes[(node - 1) // WIDE, :, (node - 1) % WIDE]
            np.testing.assert_array_equal(above[:3], tree.boxes[node, :3].min(axis=1))
            np.testing.assert_array_equal(above[3:], tree.boxes[node, 3:].max(axis=1))


def test_halves_are_compact():
    """Of many faces side by side each node of the last level spans a small part."""
    vertices, faces = bumpy_sphere(subdivisions=4)
    mixed = np.random.default_rng(0).permutation(len(faces))
    tree = face_boxes(Mesh(vertices, faces[mixed]))
    nodes = tree.boxes[tree.last_level :]
    spans = nodes[:, 3:].max(axis=2) - nodes[:, :3].min(axis=2)
    whole = np.ptp(vertices, axis=0)
    assert (spans / whole).max(axis=1).mean() < 4 * (WIDE / len(faces)) ** 0.5
