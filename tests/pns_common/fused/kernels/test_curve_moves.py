"""Curves are moved by kernels as the rule has it, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import pns
from pns_common.formula.correction import proximity_ratio
from pns_common.fused.kernels.curve_moves import (
    move_edges,
    move_vertices,
    move_vertices_but_at_tips,
)
from pns_common.masks.stencils import loop_vertex_vertices
from pns_common.rules.control_level import control_level
from tests.support.creased import MESHES, creased
from tests.support.kernels import WAYS
from tests.support.networks import scale_free_model


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("tip_strength", [None, 0.8])
@given(mesh=MESHES, seed=st.integers(0, 99), budget=st.sampled_from([0.0, 0.3, 1e9, 1e308]))
def test_curves_move_as_the_rule_has_it(way, tip_strength, mesh, seed, budget):
    strengths = {"boundary_strength": 0.9, "crease_prior": True, "tip_strength": tip_strength}
    rule = pns(scale_free_model(0, **strengths)).edge_rule.curves
    rule = replace(rule, form=replace(rule.form, budget=budget))
    topology, edges = creased(mesh, seed)
    level = control_level(mesh.vertices, topology, 0.7)
    curves, pushes = level.curves(rule.kinds), rule.pushes(level)
    loop = loop_vertex_vertices(mesh.vertices, topology)
    rows, count, movable = curves.rows.astype(np.int32), len(mesh.vertices), curves.movable
    sides = np.zeros((count, 2), dtype=np.int32)
    sides[rows] = curves.sides
    budgets = np.full(len(rows) + len(edges.sharp_edges), budget / 0.7)

    to = tuple(np.zeros(shape) for shape in ((count, 3), count, count))
    args = mesh.vertices, pushes, sides, rows, budgets, 0, len(rows)
    # As in a level, where what overflows is refused at its end.
    with np.errstate(over="ignore", invalid="ignore"):
        if tip_strength:
            WAYS[way](move_vertices_but_at_tips)(*args, loop, tip_strength, *to)
        else:
            WAYS[way](move_vertices)(*args, *to)
        expect(to, curves.rows, rule.at_vertices(level, loop[curves.rows]))

        of_edges = edges.edges, edges.sharp_edges, budgets, 0, len(edges.sharp_edges)
        to = tuple(np.zeros(shape) for shape in ((len(edges.edges), 3), *2 * [len(edges.edges)]))
        WAYS[way](move_edges)(mesh.vertices, pushes, movable, *of_edges, *to)
        expect(to, curves.edges, rule.at_edges(level))


def expect(to, rows, made):
    """Rows get what was made, all others nothing."""
    values = made.displacement + 0.0, proximity_ratio(made), made.envelope
    for written, value in zip(to, values, strict=True):
        expected = np.zeros_like(written)
        expected[rows] = value
        assert written.tobytes() == expected.tobytes()
