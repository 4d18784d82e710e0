"""The unit of length, with the bits of the array kernels."""

import numpy as np
from hypothesis import given

from pns_common.base.blocks import Blocks
from pns_common.fused.where_loaded.extent import reference_length
from pns_common.geometry.reference_length import measure_reference_length
from tests.support.meshes import manifolds, soups


@given(soups() | manifolds())
def test_the_reference_length_has_the_bits_of_the_arrays(mesh):
    length = reference_length(mesh.vertices, mesh.faces, Blocks(2, rows=5))
    assert length == measure_reference_length(mesh.vertices, mesh.faces)


def test_the_reference_length_of_a_large_mesh_has_the_bits_of_the_arrays():
    points = np.random.default_rng(0).standard_normal((100_001, 3))
    faces = np.arange(99_999).reshape(-1, 3)
    assert reference_length(points, faces, Blocks(1)) == measure_reference_length(points, faces)
