"""The faces that a step made: the largest angle between them, and which of them are flipped."""

import numpy as np
import pytest

from pns_common import Mesh, loop, pns, refine
from pns_common.base.blocks import WHOLE, Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.child_faces import angle_of_chord, child_faces
from tests.support.meshes import bent, bumpy_sphere, grid, icosphere
from tests.support.networks import random_model

MODEL = random_model(0, scale=30.0)


def slow_normal_jump(vertices, faces):
    topology = build_topology(faces, len(vertices))
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    n1, n2 = (normals[topology.edge_faces[topology.interior, side]] for side in (0, 1))
    sine = np.linalg.norm(np.cross(n1, n2), axis=1)
    return np.arctan2(sine, np.sum(n1 * n2, axis=1)).max()


@pytest.mark.parametrize("shape", [icosphere(1), grid(7, bent), bumpy_sphere(3)])
def test_normal_jump_is_the_largest_angle_across_an_edge(shape):
    refined = refine(Mesh(*shape), pns(MODEL), 2)
    expected = slow_normal_jump(refined.mesh.vertices, refined.mesh.faces)
    reported = refined.report["levels"][-1]["normal_jump_max"]
    assert reported == pytest.approx(expected, rel=1e-9)


def test_flipped_faces_are_those_that_oppose_their_loop_counterpart():
    mesh = Mesh(*bumpy_sphere(0, bump=0.4))
    refined, base = refine(mesh, pns(MODEL, 60.0)), refine(mesh, loop())

    def area_vectors(vertices):
        a, b, c = (vertices[refined.mesh.faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    opposed = np.sum(area_vectors(refined.mesh.vertices) * area_vectors(base.mesh.vertices), axis=1)
    assert refined.report["levels"][0]["flipped_faces"] == (opposed < 0).sum() > 0
    assert base.report["levels"][0]["flipped_faces"] == 0


@pytest.mark.parametrize("degrees", [0, 1e-6, 30, 90, 180])
def test_an_angle_is_that_of_its_chord(degrees):
    angle = np.radians(degrees)
    apart = np.array([1, 0]) - np.array([np.cos(angle), np.sin(angle)])
    chord = apart @ apart if degrees > 1e-3 else angle**2  # cosines round small angles away
    assert angle_of_chord(float(chord)) == pytest.approx(angle, rel=1e-12, abs=1e-15)
    assert angle_of_chord(4.0 + 1e-12) == np.pi


def test_faces_without_area_make_no_angle_and_blocks_change_nothing():
    points, faces = grid(3, bent)
    topology = build_topology(faces, len(points))
    refined = refine(Mesh(points, faces), loop()).mesh.vertices.copy()
    turned = child_faces(topology, refined * [1, 1, -1], refined, WHOLE)
    assert turned.flipped == 0
    assert child_faces(topology, refined[:, [1, 0, 2]], refined, WHOLE).flipped == 4 * len(faces)
    divided = child_faces(topology, refined, None, Blocks(2, rows=3))
    whole = child_faces(topology, refined, None, WHOLE)
    assert (divided.flipped, divided.normal_jump_max) == (0, whole.normal_jump_max)
    np.testing.assert_array_equal(divided.normals, whole.normals)
    flat = child_faces(topology, np.zeros_like(refined), refined, WHOLE)
    assert (flat.flipped, flat.normal_jump_max, flat.normals.any()) == (0, 0.0, False)


@pytest.mark.parametrize("edge", [[1, 2], [0, 2], [0, 3]])
def test_nor_does_one_without_area_beside_one_that_has_some(edge):
    """The middle child of a face, and a corner's on either side of the edge between two."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [2, -2, 0]])
    topology = build_topology(np.array([[0, 1, 2], [1, 0, 3]]), 4)
    refined = np.concatenate([points, points[topology.edges].mean(axis=1)])
    assert child_faces(topology, refined, None, WHOLE).normals.any(axis=1).all()
    at = 4 + int(np.flatnonzero((topology.edges == edge).all(axis=1))[0])
    # On the line through others that are corners of a child with it.
    refined[at] = {2: [0.5, 0, 0], 3: [0.5, 0, 0]}[edge[1]] if edge[0] == 0 else [0.5, 0.5, 0]
    made = child_faces(topology, refined, None, WHOLE)
    assert (~made.normals.any(axis=1)).any()
    assert made.normal_jump_max == 0
