"""Text PLY of polygons with texture coordinates at their corners: each corner keeps its own."""

from __future__ import annotations

import numpy as np
import pytest

from service.errors import UnreadableError
from service.meshfiles.formats import read
from service.meshfiles.ply.polygons import of_triangles

POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 2.0, 0.0)]
POLYGONS = [(0, 1, 2, 3), (0, 2, 4), (3, 2, 1, 0, 4)]
FANS = [[0, 1, 2], [0, 2, 3], [0, 2, 4], [3, 2, 1], [3, 1, 0], [3, 0, 4]]
# Corners of the polygons, counted through.
PLACES = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 8, 9], [7, 9, 10], [7, 10, 11]]
UV = np.arange(24).reshape(12, 2) / 24


def ply(polygons: list[tuple[int, ...]] = POLYGONS, beside: bool = False) -> str:
    """Polygons with coordinates that no two corners share; `beside`: with numbers around."""
    lines = [
        *("ply", "format ascii 1.0", "comment element face 99"),
        f"element vertex {len(POINTS)}",
        *(f"property float {axis}" for axis in "xyz"),
        f"element face {len(polygons)}",
        *(["property uchar red"] if beside else []),
        "property list uchar int vertex_indices",
        "property list uchar float texcoord",
        *(["property int flags"] if beside else []),
        *(["element edge 1", "property int vertex1", "property int vertex2"] if beside else []),
        "end_header",
        *("{} {} {}".format(*point) for point in POINTS),
    ]
    uv = iter(UV.tolist())
    for corners in polygons:
        own = [str(number) for _ in corners for number in next(uv)]
        row = [str(len(corners)), *map(str, corners), str(len(own)), *own]
        lines.append(" ".join(["255", *row, "7"] if beside else row))
    return "\n".join([*lines, *(["0 1"] if beside else [])]) + "\n"


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_polygons_are_cut_into_fans_and_corners_keep_their_coordinates(
    beside: bool, line_end: str
) -> None:
    mesh_file = read(ply(beside=beside).replace("\n", line_end).encode(), "ply")
    np.testing.assert_array_equal(mesh_file.vertices[mesh_file.faces], np.array(POINTS)[FANS])
    assert mesh_file.uv is not None
    np.testing.assert_array_equal(mesh_file.uv[mesh_file.faces], np.float32(UV)[PLACES])
    assert mesh_file.split == 3
    lost = {"face property red": 3, "face property flags": 3, "element edge": 1}
    assert mesh_file.unsupported == (lost if beside else {})


def test_triangles_stay_as_they_are() -> None:
    data = ply([(0, 1, 2), (0, 2, 3)]).encode()
    assert of_triangles(data) == (data, None)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("5 3 2 1 0 4 10", "5 3 2 1 0 4 8", "face 2 of the PLY file"),
        ("4 0 1 2 3 8", "4 0 1 2 3 9", "face 0 of the PLY file"),
        ("4 0 1 2 3 8", "-4 0 1 2 3 8", "face 0 of the PLY file"),
        ("4 0 1 2 3 8", "4 0 1_0 2 3 8", "face 0 of the PLY file"),
        ("4 0 1 2 3 8", "4 0 one 2 3 8", "face 0 of the PLY file"),
        ("4 0 1 2 3 8", "4 0 9999999999999999999 2 3 8", "what is no number"),
        ("element face 3", "element face 4", "4 faces and ends after 3"),
    ],
)
def test_what_is_no_polygon_with_its_coordinates_is_told(old: str, new: str, says: str) -> None:
    text = ply()
    assert old in text
    with pytest.raises(UnreadableError, match=says):
        read(text.replace(old, new).encode(), "ply")
