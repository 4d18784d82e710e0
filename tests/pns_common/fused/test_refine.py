"""Levels by kernels: looked at when the report is asked for, told as they end."""

import numpy as np

from pns_common import Mesh, loop, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES
from pns_common.connectivity.topology import build_topology
from pns_common.fused.refine import refine_fused
from tests.support.kernels import by_arrays
from tests.support.meshes import bumpy_sphere
from tests.support.networks import scale_free_model

MESH = Mesh(*bumpy_sphere(0, subdivisions=0))


def test_nobody_looks_at_the_levels_before_the_report_is_read(monkeypatch):
    looks = []
    for module in ("levels.level", "learned.learned_step"):
        look = f"pns_common.fused.{module}.look_at_children"
        original = __import__(f"pns_common.fused.{module}", fromlist=["x"]).look_at_children
        monkeypatch.setattr(look, lambda *given, o=original: (looks.append(1), o(*given))[1])
    scheme = pns(scale_free_model(0))
    made = refine_fused(MESH, scheme, 3, 1.0, NO_CREASES, Blocks(1), lambda: None)
    assert looks == []
    assert made.reports == by_arrays(MESH, 3, scheme=scheme).reports
    assert (len(looks), made.multi_fan_vertices) == (3, 0)


def test_each_level_is_told_once_when_it_ends():
    told = []
    made = refine_fused(MESH, loop(), 4, 1.0, NO_CREASES, Blocks(1), lambda: told.append(1))
    assert len(told) == 4
    assert len(made.faces) == 4**4 * 20


def test_the_topology_is_of_the_mesh_that_the_last_level_split():
    once = refine_fused(MESH, loop(), 1, 1.0, NO_CREASES, Blocks(1), lambda: None)
    twice = refine_fused(MESH, loop(), 2, 1.0, NO_CREASES, Blocks(1), lambda: None)
    expected = build_topology(once.faces, len(once.points))
    np.testing.assert_array_equal(twice.split_topology().edges, expected.edges)
    assert not twice.ratio.any()
    assert len(twice.gate) == len(twice.points)
