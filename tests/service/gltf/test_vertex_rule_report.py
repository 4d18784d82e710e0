"""Totals of the vertex rule over several meshes; files of format 1 have none."""

import pytest

from pns_common import Mesh, loop, pns, refine
from service.report import total_level
from tests.support.meshes import bent, bumpy_sphere, grid
from tests.support.networks import default_model


def levels(scheme):
    shapes = (grid(5, bent), bumpy_sphere())
    return [refine(Mesh(*shape), scheme, 1, creases=None).report["levels"][0] for shape in shapes]


def test_totals_weigh_by_the_vertices_that_may_move():
    open_grid, sphere = levels(pns(default_model(boundary_strength=0.0)))
    total = total_level([open_grid, sphere])["vertex_rule"]
    first, second = open_grid["vertex_rule"], sphere["vertex_rule"]
    assert total["vertices"] == first["vertices"] + second["vertices"] == 25 + 42
    mean = (25 * first["gate"]["mean"] + 42 * second["gate"]["mean"]) / 67
    assert total["gate"]["mean"] == pytest.approx(mean, rel=1e-12)
    ratios = [rule["proximity_ratio"]["max"] for rule in (first, second)]
    assert total["proximity_ratio"]["max"] == max(ratios)


def test_without_a_vertex_rule_nothing_is_said_of_it():
    assert "vertex_rule" not in total_level(levels(loop()))
