"""Placements: rows of them, Loop's own, and a correction scattered into them."""

import numpy as np
import pytest

from pns_common import Mesh, ParameterError, loop, refine
from pns_common.base.blocks import Blocks
from pns_common.formula.correction import Correction
from pns_common.rules.placement import (
    correct_in_blocks,
    placed_at,
    with_correction,
    without_correction,
)
from pns_common.schemes import Scheme, loop_edge_rule, loop_vertex_rule
from tests.support.meshes import bumpy_sphere

BASE = without_correction(np.arange(15.0).reshape(5, 3))
ROWS = np.array([1, 3])
CORRECTION = Correction(
    displacement=np.array([[3.0, 4, 0], [0, 0, 0]]),
    envelope=np.array([10.0, 0.0]),
    gate=np.array([0.5, 0.25]),
    degenerate=np.array([False, True]),
)


def test_a_placement_without_correction_is_loops():
    assert BASE.positions is BASE.loop
    assert not any(part.any() for part in (BASE.ratio, BASE.gate, BASE.degenerate))
    assert BASE.degenerate.dtype == bool


def test_what_is_placed_elsewhere_counts_as_distance_from_loop():
    """A scheme of two functions that keeps all vertices and takes middles."""

    def kept(level):
        return placed_at(loop_vertex_rule(level), level.points)

    def middles(level):
        return placed_at(loop_edge_rule(level), level.points[level.topology.edges].mean(axis=1))

    mesh = Mesh(*bumpy_sphere(subdivisions=0))
    flat, smooth = (refine(mesh, scheme, 2) for scheme in (Scheme("", kept, middles), loop()))
    np.testing.assert_allclose(flat.mesh.vertices[:12], mesh.vertices, atol=1e-15)
    apart = np.linalg.norm(flat.mesh.vertices - smooth.mesh.vertices, axis=1).max()
    assert 0 < apart <= flat.report["limit_distance"]
    assert flat.report["limit_distance_bound"] is None


def test_positions_of_another_number_of_vertices_are_refused():
    """One row was taken for all: every vertex lay in one point."""
    for count in (1, 4):
        with pytest.raises(ParameterError, match=rf"\({count}, 3\).*\(5, 3\)"):
            placed_at(BASE, BASE.loop[:count])


@pytest.mark.parametrize("kind", [complex, object, str])
def test_positions_that_are_no_real_numbers_are_refused(kind):
    """Complex ones came out as a complex mesh."""
    with pytest.raises(ParameterError, match=r"dtype.*expected real numbers"):
        placed_at(BASE, BASE.loop.astype(kind))


def test_a_correction_is_added_at_its_rows_alone():
    placed = with_correction(BASE, ROWS, CORRECTION)
    assert (placed.positions - BASE.loop).tolist() == [[0] * 3, [3, 4, 0], *[[0] * 3] * 3]
    assert placed.ratio.tolist() == [0, 0.5, 0, 0, 0]  # 5 of 10; 0 where nothing is allowed
    assert placed.gate.tolist() == [0, 0.5, 0, 0.25, 0]
    assert placed.degenerate.tolist() == [False, False, False, True, False]
    assert placed.envelope.tolist() == [0, 10, 0, 0, 0]


def test_rows_are_views_of_a_slice_and_copies_of_indices():
    placed = with_correction(BASE, ROWS, CORRECTION)
    part = placed.rows(slice(1, 3))
    assert np.shares_memory(part.displacement, placed.displacement)
    chosen = placed.rows(np.array([3, 1]))
    assert chosen.gate.tolist() == [0.25, 0.5]
    assert not np.shares_memory(chosen.gate, placed.gate)
    assert placed.rows(slice(0, 2)).corrected is None
    assert BASE.rows(slice(0, 2)).displacement is None


def test_a_correction_made_in_blocks_is_the_whole_one():
    def correct(rows):
        number = np.arange(20.0)[rows]
        columns = np.stack([number, -number, 2 * number], axis=1)
        return Correction(columns, number, number / 20, number > 7)

    whole, divided = (
        correct_in_blocks(blocks, 20, correct) for blocks in (Blocks(1), Blocks(2, 3))
    )
    for name in ("displacement", "envelope", "gate", "degenerate"):
        np.testing.assert_array_equal(getattr(divided, name), getattr(whole, name))
    assert whole.envelope.tolist() == list(range(20))
