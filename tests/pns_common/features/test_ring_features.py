"""What vertices see of their rings: as defined, within its ranges, with gradients everywhere."""

import numpy as np
import torch
from hypothesis import given

from pns_common.connectivity.topology import build_topology
from pns_common.features.ring_features import RING_10
from pns_common.geometry.frames import face_normals
from pns_common.geometry.rings import Rings
from tests.support.meshes import bumpy_sphere, manifolds, soups
from tests.support.plain_operator import PlainMesh

ROUNDING = 1 + 1e-12


def rings_of(points, faces):
    return Rings(build_topology(faces, len(points)), points, face_normals(points, faces))


@given(soups() | manifolds())
def test_features_keep_their_ranges(mesh):
    limits = np.array([feature.limit for feature in RING_10.features])
    assert (np.abs(RING_10(rings_of(mesh.vertices, mesh.faces))) <= limits * ROUNDING).all()


@given(soups())
def test_gradients_are_finite_on_degenerate_meshes(mesh):
    points = torch.tensor(mesh.vertices / np.abs(mesh.vertices).max(), requires_grad=True)
    RING_10(rings_of(points, mesh.faces)).sum().backward()
    assert torch.isfinite(points.grad).all()


def test_each_feature_is_as_it_is_defined():
    points, faces = bumpy_sphere(5, subdivisions=0)
    plain = PlainMesh(points, faces)
    expected = [plain.ring_features(v) for v in range(len(points))]
    np.testing.assert_allclose(RING_10(rings_of(points, faces)), expected, atol=1e-13)
