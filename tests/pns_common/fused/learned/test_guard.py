"""The fold guard by kernels takes the rounds of the array kernels' and ends at the same scales."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology, split
from pns_common.formula.fold_guard import FoldGuard
from pns_common.fused.learned.guard import guard_scale
from pns_common.fused.levels.loop_points import loop_points
from tests.support.kernels import edges_built
from tests.support.meshes import bent, bumpy_sphere, grid

MESHES = [Mesh(*bumpy_sphere(1, subdivisions=0)), Mesh(*grid(4, bent))]


@given(st.sampled_from(MESHES), st.integers(0, 2**31), st.floats(0.01, 1e6), st.booleans())
def test_scales_are_the_array_kernels(mesh, seed, size, some_shared):
    rng, edges = np.random.default_rng(seed), edges_built(mesh)
    loop = loop_points(mesh.vertices, edges, Blocks(1))
    delta = size * rng.standard_normal(loop.shape)
    shared = rng.random(len(loop)) < 0.3 if some_shared else None
    guard = FoldGuard(rng.uniform(0.05, 1.5))
    faces = split(build_topology(mesh.faces, len(mesh.vertices)))
    scale = guard_scale(guard, edges, loop, delta, Blocks(2, rows=5), shared)
    scale = np.ones(len(loop)) if scale is None else scale
    np.testing.assert_array_equal(scale, guard(faces, loop, delta, shared=shared))


@pytest.mark.parametrize(("size", "acts"), [(1e-6, False), (3.0, True)])
def test_it_acts_where_faces_fold_and_nowhere_else(size, acts):
    mesh, edges = MESHES[0], edges_built(MESHES[0])
    loop = loop_points(mesh.vertices, edges, Blocks(1))
    delta = size * np.random.default_rng(0).standard_normal(loop.shape)
    scale = guard_scale(FoldGuard(1.3), edges, loop, delta, Blocks(1))
    assert (scale is not None) == acts
    assert scale is None or scale.min() < 1
