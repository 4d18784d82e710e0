"""The children of faces by kernels: the angles and the flipped faces of the array kernels."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import WHOLE, Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.levels.child_faces import look_at_children
from pns_common.fused.levels.loop_points import loop_points
from pns_common.geometry.child_faces import child_faces
from tests.support.kernels import edges_built
from tests.support.meshes import bent, bumpy_sphere, grid, three_pages

SHAPES = {"closed": bumpy_sphere(0), "open": grid(5, bent), "pages": three_pages()}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("size", [0.0, 0.05, 1.0])
def test_angles_and_flips_are_the_array_kernels(shape, size):
    points, faces = SHAPES[shape]
    mesh = edges_built(Mesh(points, faces))
    loop = loop_points(points, mesh, Blocks(1))
    moved = loop + size * np.random.default_rng(0).standard_normal(loop.shape)
    topology = build_topology(faces, len(points))
    for counterpart in (loop, None):
        expected = child_faces(topology, moved, counterpart, WHOLE)
        for blocks in (Blocks(1), Blocks(2, rows=5)):
            seen = look_at_children(mesh, moved, counterpart, blocks)
            assert seen.flipped == expected.flipped
            assert seen.normal_jump_max == expected.normal_jump_max
    if size != 0.05:
        assert (child_faces(topology, moved, loop, WHOLE).flipped > 0) == (size == 1)
