"""Binary PLY of polygons of many sizes: the triangles of the same file as text."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from service.errors import UnreadableError
from service.meshfiles.counted import count_triangles
from service.meshfiles.formats import read
from service.meshfiles.ply.header import ply_header
from service.meshfiles.ply.polygons import of_triangles

POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 2.0, 0.0)]
POLYGONS = [(0, 1, 2, 3), (0, 2, 4), (3, 2, 1, 0, 4)]
FANS = [[0, 1, 2], [0, 2, 3], [0, 2, 4], [3, 2, 1], [3, 1, 0], [3, 0, 4]]


def ply(
    order: str = "<", polygons: list[tuple[int, ...]] | None = None, beside: bool = False
) -> bytes:
    """Polygons as Blender writes them; `beside`: with numbers around each, and edges."""
    chosen = POLYGONS if polygons is None else polygons
    lines = [
        "ply",
        f"format binary_{'little' if order == '<' else 'big'}_endian 1.0",
        "comment element face 99",
        f"element vertex {len(POINTS)}",
        *(f"property float {axis}" for axis in "xyz"),
        f"element face {len(chosen)}",
        *(["property uchar red"] if beside else []),
        "property list uchar uint vertex_indices",
        *(["property short flags"] if beside else []),
        *(["element edge 2", "property int vertex1", "property int vertex2"] if beside else []),
        "end_header",
    ]
    data = "\n".join(lines).encode() + b"\n"
    data += b"".join(struct.pack(f"{order}3f", *point) for point in POINTS)
    for corners in chosen:
        record = struct.pack(f"{order}B{len(corners)}I", len(corners), *corners)
        data += b"\xff" + record + b"\x01\x02" if beside else record
    return data + (struct.pack(f"{order}4i", 0, 1, 1, 2) if beside else b"")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("beside", [False, True])
def test_polygons_are_cut_into_fans_in_their_order(order: str, beside: bool) -> None:
    data = ply(order, beside=beside)
    mesh_file = read(data, "ply")
    np.testing.assert_array_equal(mesh_file.vertices[mesh_file.faces], np.array(POINTS)[FANS])
    assert mesh_file.split == 3
    lost = {"face property red": 3, "face property flags": 3, "element edge": 2}
    assert mesh_file.unsupported == (lost if beside else {})
    # What lies behind the faces is taken for corners.
    assert count_triangles(data, "ply") == 6 + 4 * beside


def test_one_size_stays_as_it_is() -> None:
    for polygons in ([(0, 1, 2), (0, 2, 3)], [(0, 1, 2, 3)] * 3, []):
        data = ply(polygons=polygons)
        assert of_triangles(data) == (data, None)


def test_polygons_of_fewer_than_three_corners_make_no_triangle() -> None:
    mesh_file = read(ply(polygons=[(), (1,), (0, 1), (0, 1, 2, 3)]), "ply")
    assert len(mesh_file.faces) == 2
    with pytest.raises(UnreadableError):
        read(ply(polygons=[(), (1,), (0, 1)]), "ply")


@pytest.mark.parametrize("cut", [1, 4, 20])
def test_a_file_that_was_cut_off_says_where(cut: int) -> None:
    with pytest.raises(UnreadableError, match="3 faces and ends after 2"):
        read(ply()[:-cut], "ply")


@pytest.mark.parametrize(
    "data",
    [
        ply().replace(b"face 3", b"face 9" + b"9" * 17),
        ply().replace(b"list uchar uint", b"list char uint").replace(b"\x04", b"\xff"),
        ply().replace(b"uint vertex", b"quad vertex"),
        ply()[:200],
    ],
)
def test_a_header_that_lies_is_refused(data: bytes) -> None:
    with pytest.raises(UnreadableError):
        read(data, "ply")


def test_a_header_that_is_none_is_none() -> None:
    for data in (b"", b"ply\n", b"OFF\n", ply().replace(b"end_header", b"ending")):
        assert ply_header(data) is None
