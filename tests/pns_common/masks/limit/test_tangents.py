"""Tangent masks are left eigenvectors: a step shortens what they measure by their eigenvalue."""

import numpy as np
import pytest

from pns_common.connectivity.creases import crease_children, with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.masks.limit import tangents as masks_of_tangents
from pns_common.masks.limit.neighbours import own_neighbours, split_neighbours
from pns_common.masks.limit.sectors import sectors
from pns_common.masks.limit.tangents import dart_tangents, tangent_masks
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from tests.support.stars import star


def tangents(points, topology, around):
    """Both tangents of the centre's sectors."""
    found = sectors(topology)
    masks = tangent_masks(topology, found)
    mine = np.flatnonzero(found.vertex == 0)
    spans = []
    for sector in mine:
        corners = np.flatnonzero(found.of_corner == sector)
        leaving, arriving = points[around.leaving[corners]], points[around.arriving[corners]]
        spans.append(
            masks.centre[sector][:, None] * points[0]
            + masks.leaving[corners].T @ leaving
            + masks.arriving[corners].T @ arriving
        )
    return np.array(spans)


def stepped(points, topology):
    return np.concatenate(
        [loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)]
    )


def shrunk(points, topology):
    """The tangents before and after a step."""
    before = tangents(points, topology, own_neighbours(topology))
    return before, tangents(stepped(points, topology), topology, split_neighbours(topology))


@pytest.mark.parametrize("k", [3, 4, 6, 8])
def test_around_a_smooth_vertex_both_shrink_alike(k):
    points, faces = star(k, closed=True)
    before, after = shrunk(points, build_topology(faces, len(points)))
    rate = 3 / 8 + np.cos(2 * np.pi / k) / 4
    np.testing.assert_allclose(after, rate * before, atol=1e-14)


@pytest.mark.parametrize("k", [1, 2, 3, 5])
def test_along_a_boundary_a_half_and_across_it_its_own_rate(k):
    points, faces = star(k, closed=False)
    ((along, across),), ((along_after, across_after),) = shrunk(
        points, build_topology(faces, len(points))
    )
    np.testing.assert_allclose(along_after, along / 2, atol=1e-14)
    # One face alone has no spoke inside: its second difference shrinks by a quarter.
    rate = 3 / 8 + np.cos(np.pi / k) / 4 if k > 1 else 1 / 4
    np.testing.assert_allclose(across_after, rate * across, atol=1e-14)


def test_at_a_corner_each_edge_shrinks_by_a_half():
    points, faces = star(6, closed=True)
    topology = with_creases(build_topology(faces, 7), np.array([[0, 1], [0, 3], [0, 5]]))
    before, after = shrunk(points, topology)
    assert before.shape == (3, 2, 3)
    np.testing.assert_allclose(after, before / 2, atol=1e-14)


@pytest.mark.parametrize("k", [3, 5, 8, 9, 10, 33, 200])
def test_at_a_dart_the_odd_mask_is_a_sine_and_both_span_the_plane_of_a_step(k):
    even, odd = dart_tangents(k)
    np.testing.assert_allclose(odd, np.sin(2 * np.pi * np.arange(k) / k), atol=1e-15)
    assert even.sum() == pytest.approx(0, abs=1e-12)  # of no position, but of directions
    np.testing.assert_allclose(even[2:], even[:1:-1], atol=1e-12)  # the same both ways round
    points, faces = star(k, closed=True)
    topology = with_creases(build_topology(faces, k + 1), np.array([[0, 1]]))
    ((first, second),), ((first_after, second_after),) = shrunk(points, topology)
    for before, after in ((first, first_after), (second, second_after)):
        np.testing.assert_allclose(np.cross(before, after), 0, atol=1e-12)
    assert len(crease_children(topology)) == 2


def test_masks_of_common_darts_are_found_once(monkeypatch):
    first = [dart_tangents(k) for k in (5, 12, 63)]
    sought = []
    monkeypatch.setattr(masks_of_tangents, "_even_at", lambda t, k: sought.append(k))
    monkeypatch.setattr(np.linalg, "eig", sought.append)
    again = [dart_tangents(k) for k in (5, 12, 63)]
    assert sought == []
    assert [even.tolist() for even, _ in again] == [even.tolist() for even, _ in first]
