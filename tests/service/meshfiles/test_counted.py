"""The triangles that a file is said to give are those that are read."""

from __future__ import annotations

import re
import tracemalloc

import numpy as np
import pytest
import trimesh

from service.meshfiles import counted
from service.meshfiles.counted import BYTES_PER_FACE, count_triangles
from service.meshfiles.formats import read
from service.options import Limits
from service.workers.measure import cost_of_other

# A thousand polygons of as many sizes, on the same vertices: five bytes a triangle.
SIZES = range(3, 1003)
POINTS = np.random.default_rng(0).normal(size=(1002, 3))


def text_of(kind: str) -> bytes:
    vertices = [" ".join(f"{value:.6f}" for value in point) for point in POINTS]
    if kind == "obj":
        faces = ["f " + " ".join(str(1 + corner) for corner in range(size)) for size in SIZES]
        return "\n".join([*(f"v {vertex}" for vertex in vertices), *faces]).encode()
    faces = [f"{size} " + " ".join(str(corner) for corner in range(size)) for size in SIZES]
    counts = f"OFF\n# of many sizes\n{len(vertices)} {len(faces)} 0"
    if kind == "ply":
        counts = (
            f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
            "property float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list int int vertex_indices\nend_header"
        )
    return "\n".join([counts, *vertices, *faces, ""]).encode()


@pytest.mark.parametrize("kind", ["obj", "off", "ply"])
def test_polygons_of_many_corners_count_as_the_triangles_that_they_become(kind: str) -> None:
    data = text_of(kind)
    triangles = len(read(data, kind).faces)
    assert triangles > 5 * len(data) // BYTES_PER_FACE
    assert count_triangles(data, kind) == triangles
    assert count_triangles(data.replace(b"\n", b"\r\n"), kind) == triangles
    assert cost_of_other(data, kind, 1, Limits()).faces == 4 * triangles


@pytest.mark.parametrize("file_type", ["stl", "stl_ascii"])
def test_an_stl_counts_as_the_faces_that_it_has(file_type: str) -> None:
    """A client pays for what is predicted: of a text that was seven times what it made."""
    data = trimesh.creation.icosphere(3).export(file_type=file_type)
    data = data if isinstance(data, bytes) else data.encode()
    faces = len(read(data, "stl").faces)
    assert count_triangles(data, "stl") == faces == 1280
    if file_type == "stl_ascii":
        # In one line, and of several solids.
        assert count_triangles(data.replace(b"\n", b" "), "stl") == faces
        assert count_triangles(data + b"\n" + data, "stl") == 2 * faces


def test_a_face_of_an_obj_that_goes_on_in_the_next_line_is_one() -> None:
    data = text_of("obj")
    torn = re.sub(rb" 7 8 ", b" 7 \\\\\n8 ", data)
    assert torn.count(b"\n") > data.count(b"\n")
    assert count_triangles(torn, "obj") == count_triangles(data, "obj")


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "stl"])
@pytest.mark.parametrize(
    "data", [b"", b"\n", b"f", b"\\", b"OFF\n", b"OFF 9 99 0", b"ply\nformat ascii"]
)
def test_what_is_no_mesh_counts_as_nearly_nothing(data: bytes, kind: str) -> None:
    assert count_triangles(data, kind) <= 1


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("obj", b"\n"),
        ("obj", b" f\n"),
        ("obj", b"\\\n"),
        ("obj", b"#\n"),
        ("off", b"\n"),
        ("off", b"#\n"),
        ("off", b"9 9\n"),
        ("off", b"1 "),
        ("ply", b"1 \n"),
        ("stl", b"f\n"),
        ("stl", b"v "),
    ],
)
def test_counting_takes_little_beside_the_file(kind: str, line: bytes) -> None:
    """It is done to any file before its job has a turn, beside the worker of another."""
    head = {
        "obj": b"v 0 0 0\n",
        "stl": b"solid\n",
        "off": b"OFF\n",
        "ply": b"ply\nformat ascii 1.0\nelement face 9999999\nproperty list int int vertex_index\n"
        b"end_header\n",
    }[kind]
    data = head + line * (8 * 2**20 // len(line))
    tracemalloc.start()
    count_triangles(data, kind)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 4 * len(data) + 2**25


def test_pieces_count_as_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever they end: lines that go on, comments, blank lines and a last one without an end."""
    text = text_of("obj").replace(b" 7 8 ", b" 7 \\\n8 ")
    text = text.replace(b"\nf ", b"\n\n# f 1 2 3\\\n \tf ")
    off = text_of("off").replace(b"\n3 ", b"\n\n3 ").rstrip(b"\n")
    whole = count_triangles(text, "obj"), count_triangles(off, "off")
    assert whole == (sum(SIZES) - 2 * len(SIZES),) * 2
    for piece in (1, 7, 1000):
        monkeypatch.setattr(counted, "PIECE", piece)
        assert (count_triangles(text, "obj"), count_triangles(off, "off")) == whole
