"""Borders of groups on flat sides are found, and where the shape bends none is."""

import numpy as np
import pytest

from pns_common.flat_borders import flat_borders
from tests.support.meshes import grid, rotation
from train.data.primitives import cylinder


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
    """The edges of two faces of different groups with all of both ends' faces in one plane."""
    faces_at, normals, open_at = {}, {}, set()
    for number, face in enumerate(faces.tolist()):
        a, b, c = points[face]
        normal = np.cross(b - a, c - a)
        for u, v in zip(face, face[1:] + face[:1], strict=True):
            faces_at.setdefault(frozenset((u, v)), []).append(number)
            normals.setdefault(u, []).append(normal / np.linalg.norm(normal))
    for edge, beside in faces_at.items():
        open_at |= edge if len(beside) != 2 else set()
    flat = {v for v, own in normals.items() if np.ptp(own, axis=0).max() < 1e-3} - open_at
    two = {edge for edge, own in faces_at.items() if len({*group[own].tolist()}) == 2}
    return {edge for edge in two if edge <= flat}


def found(points, faces, group):
    return {frozenset(pair) for pair in flat_borders(points, faces, group).tolist()}


@pytest.mark.parametrize("degrees", [0, 40])
def test_the_borders_on_flat_sides_are_those_of_two_groups(degrees):
    points, faces, group = sheet(degrees)
    borders = found(points, faces, group)
    assert borders == expected(points, faces, group)
    assert len(borders) > 10
    turned = 1e3 * points @ rotation(np.random.default_rng(0)).T.astype(np.float32)
    assert found(turned.astype(np.float32).astype(float), faces, group) == borders


def test_a_border_along_a_bend_is_none():
    points, faces, _ = sheet(0.3)
    group = (points[faces].mean(axis=1)[:, 1] > 0).astype(int)
    assert found(points, faces, group) == set()
    points, _, _ = sheet(0.03)
    assert len(found(points, faces, group)) == 6


@pytest.mark.parametrize("sectors", [2, 3, 6])
def test_borders_that_reach_a_rim_end_before_it(sectors):
    """As creases they would make corners of it, and dents of a round one."""
    rounded = cylinder(12, rows=2)
    middle = rounded.vertices[rounded.faces].mean(axis=1)
    angle = np.arctan2(middle[:, 1], middle[:, 0])
    group = np.floor(angle / (2 * np.pi / sectors)).astype(int)
    assert found(rounded.vertices, rounded.faces, group) == set()


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
    away = {other for other in found(points, faces, group) if not other & edge}
    assert found(third, more, np.append(group, 7)) == away


@pytest.mark.parametrize("degrees", [0, 40])
def test_faces_without_area_that_fill_in_part_no_plane(degrees):
    """Where a vertex lies on a longer edge, what fills in has its three corners on a line."""
    points, faces, group = sheet(degrees)
    before = found(points, faces, group)
    a, b, c = next(face for face in faces[group == 1].tolist() if frozenset(face[:2]) in before)
    first = int(np.flatnonzero((faces == [a, b, c]).all(axis=1))[0])
    middle = len(points)
    filled = np.vstack([faces, [middle, b, c], [a, b, middle]])
    filled[first] = a, middle, c
    halves = {frozenset((a, middle)), frozenset((middle, b))}
    more = np.vstack([points, points[[a, b]].mean(axis=0)])
    assert found(more, filled, np.append(group, [1, 0])) == before - {frozenset((a, b))} | halves
