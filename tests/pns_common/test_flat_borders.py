"""Borders of groups on flat sides are found, and where the shape bends none is."""

import numpy as np
import pytest

from pns_common.flat_borders import flat_borders
from tests.support.meshes import grid, rotation


def sheet(degrees=0.0):
    """Eight by eight squares over (−1, 1)², folded along the middle; the group of each face.

    A rectangle of three by two squares lies in one half, a strip in the other.
    """
    points, faces = grid(9)
    x, y = points[faces].mean(axis=1)[:, :2].T
    group = np.where((abs(x) < 0.375) & (y > 0.25) & (y < 0.75), 1, np.where(y < -0.5, 2, 0))
    half = np.radians(degrees) / 2
    tilted = [points[:, 0], points[:, 1] * np.cos(half), -abs(points[:, 1]) * np.sin(half)]
    return np.stack(tilted, axis=1), faces, group


def expected(points, faces, group):
    """The edges of two faces of different groups, face by face."""
    faces_at = {}
    for face, own in zip(faces.tolist(), group.tolist(), strict=True):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            faces_at.setdefault(frozenset((a, b)), []).append(own)
    return {edge for edge, groups in faces_at.items() if len({*groups}) == 2}


def found(points, faces, group):
    return {frozenset(pair) for pair in flat_borders(points, faces, group).tolist()}


@pytest.mark.parametrize("degrees", [0, 40])
def test_the_borders_on_flat_sides_are_those_of_two_groups(degrees):
    points, faces, group = sheet(degrees)
    borders = found(points, faces, group)
    assert borders == expected(points, faces, group)
    assert len(borders) > 15
    turned = 1e3 * points @ rotation(np.random.default_rng(0)).T.astype(np.float32)
    assert found(turned.astype(np.float32).astype(float), faces, group) == borders


def test_a_border_along_a_bend_is_none():
    points, faces, _ = sheet(0.3)
    group = (points[faces].mean(axis=1)[:, 1] > 0).astype(int)
    assert found(points, faces, group) == set()
    points, _, _ = sheet(0.03)
    assert len(found(points, faces, group)) == 8


def test_one_group_a_face_without_area_and_three_faces_at_an_edge_make_none():
    points, faces, group = sheet()
    assert found(points, faces, np.zeros(len(faces), dtype=int)) == set()
    assert found(points, faces[:0], group[:0]) == set()
    flat = points.copy()
    flat[:, 1] = 0  # no face has an area
    assert found(flat, faces, group) == set()
    edge = next(iter(expected(points, faces, group)))
    third = np.vstack([points, [0, 0, 1]])
    more = np.vstack([faces, [*edge, len(points)]])
    assert found(third, more, np.append(group, 7)) == found(points, faces, group) - {edge}
