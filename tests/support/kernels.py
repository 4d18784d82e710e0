"""Both ways through the levels, compared bit for bit."""

import json

import numpy as np

from pns_common import loop
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import Creases
from pns_common.fused import KERNEL_ROWS
from pns_common.fused.levels.mesh_edges import build_edges
from pns_common.fused.refine import refine_fused
from pns_common.refine import refine_arrays


def _nothing():
    """No progress to report."""


def by_arrays(mesh, levels, creases=None, scheme=None, length=1.0):
    scheme = scheme or loop()
    return refine_arrays(mesh, scheme, levels, length, Creases(creases), Blocks(1), _nothing)


def by_kernels(mesh, levels, creases=None, scheme=None, length=1.0, threads=1, rows=KERNEL_ROWS):
    scheme = scheme or loop()
    return refine_fused(
        mesh, scheme, levels, length, Creases(creases), Blocks(threads, rows), _nothing
    )


def assert_same_bits(left, right):
    for name in ("points", "faces", "ratio", "gate"):
        a, b = getattr(left, name), getattr(right, name)
        assert (a.dtype, a.shape) == (b.dtype, b.shape)
        assert a.tobytes() == b.tobytes(), (name, np.abs(a - b).max())
    assert json.dumps(left.reports) == json.dumps(right.reports)
    assert left.multi_fan_vertices == right.multi_fan_vertices


def assert_kernels_agree(mesh, levels, creases=None, scheme=None, length=1.0):
    arrays = by_arrays(mesh, levels, creases, scheme, length)
    assert_same_bits(arrays, by_kernels(mesh, levels, creases, scheme, length))


def edges_of(mesh, count, seed):
    """A few edges of a mesh, as vertex pairs."""
    rng = np.random.default_rng(seed)
    return mesh.faces[rng.integers(0, len(mesh.faces), count)][:, :2]


def edges_built(mesh):
    """A mesh's connectivity as kernels read it."""
    return build_edges(np.asarray(mesh.faces).astype(np.int32), len(mesh.vertices), Blocks(1))


# A kernel as it is compiled, and as the Python that it is written in.
WAYS = {"compiled": lambda kernel: kernel, "plain": lambda kernel: kernel.function}
