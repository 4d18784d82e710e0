"""The boundary's rule on a fan around one vertex: Loop's curve masks of the pushes, within ρ."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.rules.control_level import control_level
from pns_common.rules.curves import CurveRule
from pns_common.rules.placement import Placement
from pns_common.rules.scale_free_form import ScaleFreeForm

SIDES, R = 9, 0.7
ANGLE = 2 * np.pi * np.arange(SIDES) / SIDES
RIM = np.stack([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE], axis=1)
POINTS = np.concatenate([RIM, [[0, 0, 0.2]]])
AROUND = np.arange(SIDES)
FACES = np.stack([AROUND, (AROUND + 1) % SIDES, np.full(SIDES, SIDES)], axis=1)
LEVEL = control_level(POINTS, build_topology(FACES, SIDES + 1), reference_length=R)
AT_RIM = np.flatnonzero((LEVEL.topology.edges < SIDES).all(axis=1))


def rule(budget):
    return CurveRule(ScaleFreeForm(budget, 1.0, 0.4, 75.0, 1, boundary_strength=0.8), 1e6)


def placed(count):
    """Nothing added yet."""
    zero = np.zeros(count)
    return Placement(
        np.zeros((count, 3)), np.zeros((count, 3)), zero, zero, zero > 1, envelope=np.zeros(count)
    )


def pushes():
    """d of the rim, along its radius: the third of the sagitta over a vertex, times b."""
    d = np.zeros_like(POINTS)
    d[:SIDES] = 0.8 / 3 * (1 - np.cos(2 * np.pi / SIDES)) * RIM
    return d


def test_the_pushes_of_a_polygon_are_a_third_of_its_sagittas():
    np.testing.assert_allclose(rule(1.0).pushes(LEVEL), pushes(), atol=1e-9)


def test_vertices_move_by_the_curve_mask_of_the_pushes_and_edges_by_their_mean():
    d, loose = pushes(), rule(1e6)
    moved = loose.move_vertices(LEVEL, placed(SIDES + 1))
    curve = 3 / 4 * d[:SIDES] + (np.roll(d[:SIDES], 1, 0) + np.roll(d[:SIDES], -1, 0)) / 8
    np.testing.assert_allclose(moved.displacement[:SIDES], curve, atol=1e-9)
    assert not moved.displacement[SIDES:].any()
    assert moved.corrected.tolist() == [True] * SIDES + [False]
    made = loose.move_edges(LEVEL, placed(len(LEVEL.topology.edges)))
    a, b = LEVEL.topology.edges[AT_RIM].T
    np.testing.assert_allclose(made.displacement[AT_RIM], (d[a] + d[b]) / 2, atol=1e-9)
    assert not np.delete(made.displacement, AT_RIM, axis=0).any()


@pytest.mark.parametrize("budget", [1e-3, 0.01])
def test_nothing_moves_by_more_than_the_budget_allows(budget):
    square = 2 - 2 * np.cos(2 * np.pi / SIDES)  # of every side, and so of every vertex
    tight = rule(budget)
    for made, rows in (
        (tight.move_vertices(LEVEL, placed(SIDES + 1)), slice(0, SIDES)),
        (tight.move_edges(LEVEL, placed(len(LEVEL.topology.edges))), AT_RIM),
    ):
        np.testing.assert_allclose(made.envelope[rows], budget / R * square, rtol=1e-12)
        length = np.linalg.norm(made.displacement[rows], axis=1)
        np.testing.assert_allclose(length, made.envelope[rows], rtol=1e-12)
        np.testing.assert_allclose(made.ratio[rows], 1, rtol=1e-12)
