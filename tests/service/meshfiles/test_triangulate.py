"""Polygons become triangles of the same area that use every corner and do not fold over."""

from __future__ import annotations

import numpy as np
import pytest

from service.errors import LimitError
from service.meshfiles import convert
from service.meshfiles.mesh_file import MeshFile, offsets_of
from service.meshfiles.triangulate import cut_polygons, triangulated
from service.options import Limits, Options


def cut(points: list, *polygons: list[int]) -> MeshFile:
    vertices = np.array([(*point, 0.0)[:3] for point in points], dtype=np.float64)
    sizes = np.array([len(polygon) for polygon in polygons])
    return triangulated(MeshFile(vertices, offsets_of(sizes), np.concatenate(polygons)))


def areas(mesh: MeshFile) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.cross(b - a, c - a) / 2


def shoelace(points: np.ndarray) -> float:
    x, y = points.T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)


SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4)]
PANE = [(1, 1), (1, 2), (2, 2), (2, 1)]
SHAPES = {
    "a letter U": ([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], None, 7),
    "a dart": ([(2, 1), (0, 0), (2, -1), (0.5, 0)], None, 0.5),
    "a dart from its tip": ([(0.5, 0), (2, 1), (0, 0), (2, -1)], None, 0.5),
    "corners on straight sides": ([(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2)], None, 4),
    "a triangle of four corners": ([(0, 0), (1, 0), (2, 0), (1, 2)], None, 2),
    "an L with corners on its sides": (
        [(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (1, 1.5), (1, 1), (0.5, 1), (0, 1)],
        None,
        3,
    ),
    "a hole behind a bridge": (SQUARE + PANE, [0, 1, 2, 3, 0, 4, 5, 6, 7, 4], 15),
    "two holes": (
        [*SQUARE, *PANE, (2.5, 2.5), (2.5, 3.5), (3.5, 3.5), (3.5, 2.5)],
        [0, 1, 2, 10, 11, 8, 9, 10, 2, 3, 0, 4, 5, 6, 7, 4],
        14,
    ),
    "repeated corners": (
        [(0, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1)],
        [0, 0, 1, 1, 2, 3, 4, 4, 5],
        3,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("shift", [0, 1, 3])
def test_area_and_corners_are_kept_from_wherever_the_outline_begins(name: str, shift: int) -> None:
    points, outline, area = SHAPES[name]
    outline = np.roll(list(range(len(points))) if outline is None else outline, shift).tolist()
    mesh = cut(points, outline)
    each = areas(mesh)[:, 2]
    assert each.sum() == pytest.approx(area, rel=1e-9)
    assert (each > 0).all()
    assert set(mesh.corners) == set(outline)


def test_a_star_shaped_outline_in_any_plane_keeps_its_area() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 30))
        if np.diff(angle, append=angle[0] + 2 * np.pi).max() > 3:
            continue
        flat = (0.05 + rng.random((30, 1))) * np.column_stack([np.cos(angle), np.sin(angle)])
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        points = np.column_stack([flat, np.zeros(30)]) @ turn + 1000 * rng.normal(size=3)
        mesh = triangulated(MeshFile(points, np.array([0, 30]), np.arange(30)))
        total = np.linalg.norm(areas(mesh), axis=1).sum()
        assert total == pytest.approx(shoelace(flat), rel=1e-9)
        normals = areas(mesh)
        assert (normals @ normals[0] > 0).all()


@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("shift", range(9))
def test_a_side_that_turns_back_to_where_it_came_from_has_no_area(turn: int, shift: int) -> None:
    points = [(0, 0), (4, 0), (4, 4), (2, 4), (2, 6), (2, 8), (2, 6), (2, 4), (0, 4)]
    mesh = cut(points, np.roll(range(9), shift)[::turn].tolist())
    assert np.abs(areas(mesh)).sum() == pytest.approx(16, rel=1e-9)
    assert {(2, 4)} <= {tuple(point) for point in mesh.vertices[mesh.corners][:, :2].tolist()}
    beyond = cut([*points[:6], (2, 5), (0, 4)], [*range(8)])
    assert any("cross themselves" in change.what for change in beyond.changes)


def test_a_whisker_of_thousands_of_corners_is_cut_like_any_polygon() -> None:
    """Each corner of it lies on a straight side: all belong to triangles that have an area."""
    count = 8_000
    side = np.stack([np.linspace(0, 1, count), np.zeros(count)], axis=1)
    points = np.concatenate([side, [[1.0, 1.0], [0.5, 0.25], [0.0, 1.0]]])
    vertices = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    cut = cut_polygons(vertices, np.array([0, len(points)]), np.arange(len(points)))
    a, b, c = (points[cut.places[:, corner]] for corner in range(3))
    (x, y), (u, v) = (b - a).T, (c - a).T
    areas = (x * v - y * u) / 2
    assert len(cut.places) == len(points) - 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(0.625)


@pytest.mark.parametrize("scheme", ["loop", "catmull-clark"])
def test_polygons_of_too_many_corners_are_refused_before_they_are_cut(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for cutter in ("triangulated", "in_star_shaped_pieces"):
        monkeypatch.setattr(convert, cutter, lambda mesh: pytest.fail("it was cut"))
    data = b"v 0 0 0\nv 9 0 0\nv 1 1 0\nv 0 9 0\nf 1 2 3 4\n"
    with pytest.raises(LimitError) as refused:
        convert.converted(
            data, "obj", "obj", Options(levels=3, scheme=scheme), None, Limits(max_faces=63)
        )
    assert (refused.value.allowed, refused.value.found) == (63, 64)
