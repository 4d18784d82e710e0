"""The measured numbers of a level, each by a slow and obvious formula."""

import numpy as np
import pytest

from pns_common import Mesh, loop, pns, refine
from pns_common.topology import build_topology
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


def test_summaries_are_the_percentile_and_the_share_that_they_name():
    mesh = Mesh(*bumpy_sphere(1, subdivisions=2))
    refined = refine(mesh, pns(MODEL))
    at_edges = slice(len(mesh.vertices), None)
    ratio, gate = np.sort(refined.ratio[at_edges]), refined.gate[at_edges]
    level = refined.report["levels"][0]
    # All edges are interior. The 99th percentile by hand, between two order statistics.
    place = 0.99 * (len(ratio) - 1)
    below = int(place)
    expected = ratio[below] + (place - below) * (ratio[below + 1] - ratio[below])
    assert level["proximity_ratio"]["p99"] == pytest.approx(expected, rel=1e-12)
    assert level["gate"]["active"] == np.mean(gate > 0.01)
    assert 0 < level["gate"]["active"] < 1
    assert np.mean(gate > 0.5) != level["gate"]["active"]


def test_flipped_faces_are_those_that_oppose_their_loop_counterpart():
    mesh = Mesh(*bumpy_sphere(0, bump=0.4))
    refined, base = refine(mesh, pns(MODEL, 60.0)), refine(mesh, loop())

    def area_vectors(vertices):
        a, b, c = (vertices[refined.mesh.faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    opposed = np.sum(area_vectors(refined.mesh.vertices) * area_vectors(base.mesh.vertices), axis=1)
    assert refined.report["levels"][0]["flipped_faces"] == (opposed < 0).sum() > 0
    assert base.report["levels"][0]["flipped_faces"] == 0
