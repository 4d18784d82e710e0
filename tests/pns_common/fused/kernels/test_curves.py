"""Curves by kernels, as the formulas have them to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns
from pns_common.connectivity.creases import with_crease_rows
from pns_common.connectivity.topology import build_topology
from pns_common.formula.correction import proximity_ratio
from pns_common.formula.curve_prior import (
    BOUNDARIES,
    BOUNDARIES_AND_CREASES,
    are_of,
    curve_gate,
    curve_pushes,
    find_curves,
)
from pns_common.fused.kernels import curves as kernels
from pns_common.masks.stencils import loop_vertex_vertices
from pns_common.rules.control_level import control_level
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bent, grid, manifolds, soups
from tests.support.networks import scale_free_model

MESHES = manifolds() | soups() | st.sampled_from([Mesh(*grid(5, bent))])
SHARPNESS = 3.0


def creased(mesh, seed):
    """A mesh's connectivity with some creases, for the formulas and for the kernels."""
    rng, plain = np.random.default_rng(seed), build_topology(mesh.faces, len(mesh.vertices))
    some = rng.random(len(plain.interior)) < 0.3
    topology = with_crease_rows(plain, plain.interior[some])
    edges = edges_built(mesh)
    edges.edge_class[:] = topology.edge_class
    return topology, edges


def followed(edges, kinds, way):
    count = edges.vertex_count
    sides, met = np.zeros((count, 2), dtype=np.int32), np.full(count, 9, dtype=np.int8)
    of_curve = are_of(kinds, edges.edge_class)
    sharp = edges.sharp if len(edges.sharp) else np.zeros(count, dtype=np.int32)
    for begin, end in ((0, count // 2), (count // 2, count)):
        args = edges.edges, edges.sharp_edges, of_curve, sharp, begin, end
        way(kernels.follow_curves)(*args, sides, met)
    return sides, met == 2


def pushed(mesh, curves, sides, strength, way):
    """The pushes of a mesh's curves, in two blocks."""
    pushes, rows = np.zeros(mesh.vertices.shape), curves.rows.astype(np.int32)
    for begin, end in ((0, len(rows) // 2), (len(rows) // 2, len(rows))):
        turns = np.empty(end - begin)
        way(kernels.measure_turns)(mesh.vertices, sides, rows, begin, end, turns)
        gates = curve_gate(turns, SHARPNESS)
        around = mesh.vertices, sides, rows, gates, strength
        way(kernels.push_curves)(*around, begin, end, pushes)
    return pushes


@pytest.mark.parametrize("way", WAYS)
@given(mesh=MESHES, kinds=st.sampled_from([BOUNDARIES, BOUNDARIES_AND_CREASES]))
def test_curves_and_their_pushes_are_the_formulas(way, mesh, kinds):
    topology, edges = creased(mesh, 0)
    curves = find_curves(mesh.vertices, topology, kinds)
    sides, movable = followed(edges, kinds, WAYS[way])
    np.testing.assert_array_equal(movable, curves.movable)
    np.testing.assert_array_equal(sides[movable], curves.sides)
    pushes = pushed(mesh, curves, sides, 0.7, WAYS[way])
    assert pushes.tobytes() == (0.7 * curve_pushes(curves, SHARPNESS)).tobytes()


@pytest.mark.parametrize("way", WAYS)
@given(mesh=MESHES, seed=st.integers(0, 99))
def test_sums_of_pushes_are_loops_beside_curves(way, mesh, seed):
    topology, edges = creased(mesh, seed)
    movable = find_curves(mesh.vertices, topology, BOUNDARIES_AND_CREASES).movable
    rng, count = np.random.default_rng(seed), len(mesh.vertices)
    pushes = np.where(movable[:, None], rng.standard_normal((count, 3)), 0.0)
    sums, expected = (np.full((count, 3), 9.0) for _ in range(2))
    args = edges.edges, edges.edge_reach
    for begin, end in ((0, count // 3), (count // 3, count)):
        WAYS[way](kernels.sum_pushes)(pushes, movable, *args, begin, end, sums)
    for v in range(count):
        # In the order of the edges.
        expected[v] = 0.0
        for a, b in edges.edges.tolist():
            expected[v] += pushes[b] if a == v else 0.0
            expected[v] += pushes[a] if b == v else 0.0
    assert sums.tobytes() == expected.tobytes()


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
    sides, movable = followed(edges, rule.kinds, WAYS[way])
    rows, count = curves.rows.astype(np.int32), len(mesh.vertices)
    budgets = np.full(len(rows) + len(edges.sharp_edges), budget / 0.7)

    to = tuple(np.zeros(shape) for shape in ((count, 3), count, count))
    args = mesh.vertices, pushes, sides, rows, budgets, 0, len(rows)
    # As in a level, where what overflows is refused at its end.
    with np.errstate(over="ignore", invalid="ignore"):
        if tip_strength:
            WAYS[way](kernels.move_vertices_but_at_tips)(*args, loop, tip_strength, *to)
        else:
            WAYS[way](kernels.move_vertices)(*args, *to)
        expect(to, curves.rows, rule.at_vertices(level, loop[curves.rows]))

        of_edges = edges.edges, edges.sharp_edges, budgets, 0, len(edges.sharp_edges)
        to = tuple(np.zeros(shape) for shape in ((len(edges.edges), 3), *2 * [len(edges.edges)]))
        WAYS[way](kernels.move_edges)(mesh.vertices, pushes, movable, *of_edges, *to)
        expect(to, curves.edges, rule.at_edges(level))


def expect(to, rows, made):
    """Rows get what was made, all others nothing."""
    values = made.displacement + 0.0, proximity_ratio(made), made.envelope
    for written, value in zip(to, values, strict=True):
        expected = np.zeros_like(written)
        expected[rows] = value
        assert written.tobytes() == expected.tobytes()
