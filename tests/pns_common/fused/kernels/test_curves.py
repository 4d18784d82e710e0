"""Curves by kernels, as the formulas have them to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.formula.curve_prior import (
    BOUNDARIES,
    BOUNDARIES_AND_CREASES,
    are_of,
    curve_gate,
    curve_pushes,
    find_curves,
)
from pns_common.fused.kernels import curves as kernels
from tests.support.creased import MESHES, creased
from tests.support.kernels import WAYS

SHARPNESS = 3.0


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
