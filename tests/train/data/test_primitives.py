"""Primitives: closed, oriented outwards, with the counts that their names say."""

import numpy as np
import pytest
from pns_common.connectivity.topology import EdgeClass, build_topology

from train.data.dense_meshes import is_manifold
from train.data.primitives import PRIMITIVES, TRIANGULATED_QUADS, cylinder, icosphere, l_block
from train.metrics.fairness import volume

ALL = {**PRIMITIVES, **TRIANGULATED_QUADS}


@pytest.mark.parametrize("name", ALL)
def test_is_closed_manifold_and_faces_outwards(name):
    mesh = ALL[name]()
    topology = build_topology(mesh.faces, len(mesh.vertices))
    assert (topology.edge_class == EdgeClass.INTERIOR).all()
    assert is_manifold(mesh)
    assert volume(mesh) > 0


def test_volumes_and_counts():
    assert volume(l_block()) == pytest.approx(3)
    assert volume(cylinder(200, 3, 2.0)) == pytest.approx(2 * np.pi, rel=1e-3)
    for splits, faces in enumerate((20, 80, 320)):
        sphere = icosphere(splits)
        assert len(sphere.faces) == faces
        np.testing.assert_allclose(np.linalg.norm(sphere.vertices, axis=1), 1)
    globe = PRIMITIVES["globe 20"]()
    valence = np.bincount(build_topology(globe.faces, len(globe.vertices)).edges.reshape(-1))
    assert sorted(valence)[-2:] == [20, 20]
