"""Totals of the vertex rule over several meshes; files of format 1 have none."""

import pytest

from pns_common import Mesh, loop, pns, refine
from service.gltf.report import total_level
from tests.meshes import bent, bumpy_sphere, grid
from tests.pns_common.test_vertex_rule import MODELS


def levels(scheme):
    shapes = (grid(5, bent), bumpy_sphere())
    return [refine(Mesh(*shape), scheme).report["levels"][0] for shape in shapes]


def test_totals_weigh_by_the_vertices_that_may_move():
    one, other = levels(pns(MODELS[0]))
    total = total_level([one, other])["vertex_rule"]
    first, second = one["vertex_rule"], other["vertex_rule"]
    assert total["vertices"] == first["vertices"] + second["vertices"] == 9 + 42
    mean = (9 * first["gate"]["mean"] + 42 * second["gate"]["mean"]) / 51
    assert total["gate"]["mean"] == pytest.approx(mean, rel=1e-12)
    ratios = [rule["proximity_ratio"]["max"] for rule in (first, second)]
    assert total["proximity_ratio"]["max"] == max(ratios)


def test_without_a_vertex_rule_nothing_is_said_of_it():
    assert "vertex_rule" not in total_level(levels(loop()))
