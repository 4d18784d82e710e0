"""Double positions: what OBJ, PLY and OFF hold is not rounded, and where it must be, it is said."""

import numpy as np
import pytest

from pns_common.mesh.mesh import Mesh
from pns_common.operator.scheme import loop
from pns_common.refinement import refine
from service.meshfiles import formats
from service.meshfiles.formats import rounding_changes
from service.meshfiles.mesh_file import of_triangles
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.options import Limits, Options

SIDE = 12


def grid(*, spacing, offset):
    """A square of SIDE × SIDE vertices, so far along x."""
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    points = np.column_stack([offset + spacing * x.ravel(), spacing * y.ravel(), 0 * x.ravel()])
    a = (SIDE * np.arange(SIDE - 1)[:, None] + np.arange(SIDE - 1)).ravel()
    b, c, d = a + SIDE, a + SIDE + 1, a + 1
    return of_triangles(points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


PLY_HEAD = """ply
format ascii 1.0
element vertex {vertices}
property double x
property double y
property double z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def double_ply(triangles):
    head = PLY_HEAD.format(vertices=len(triangles.vertices), faces=len(triangles.faces))
    rows = [" ".join(map(repr, row)) for row in triangles.vertices.tolist()]
    rows += ["3 " + " ".join(map(str, row)) for row in triangles.faces.tolist()]
    return (head + "\n".join(rows) + "\n").encode()


@pytest.mark.parametrize("kind", ["obj", "off", "ply"])
@pytest.mark.parametrize(("spacing", "offset"), [(0.1, 4.5e6), (1e-46, 0.0), (1e40, 1e41)])
def test_coordinates_beyond_float32_keep_every_face(kind, spacing, offset):
    triangles = grid(spacing=spacing, offset=offset)
    data = double_ply(triangles) if kind == "ply" else formats.write(triangles, kind)
    read = formats.read(data, kind)
    fine, report = refine_mesh_file(read, loop(), Options(scheme="loop", levels=1), Limits())
    assert report["dropped"] == {"degenerate_faces": 0, "duplicate_faces": 0, "vertices": 0}
    assert len(fine.faces) == 4 * len(triangles.faces)
    expected = refine(Mesh(read.vertices, read.faces), loop(), 1).mesh
    np.testing.assert_array_equal(fine.vertices[fine.faces], expected.vertices[expected.faces])


@pytest.mark.parametrize(("offset", "told"), [(4.5e6, True), (4e5, True), (1e4, False), (0, False)])
def test_faces_of_few_steps_of_float32_are_counted(offset, told):
    """Of a map in metres, which rounding turns by some tenths of a degree."""
    triangles = grid(spacing=1.1, offset=offset)
    triangles.vertices[:, 2] = triangles.vertices[:, 0] - offset
    changes = rounding_changes(triangles)
    assert [change.count for change in changes] == [len(triangles.faces)] * told
    assert (turned_by_rounding(triangles) > 0.1) == told


def turned_by_rounding(triangles):
    """Return the degrees by which rounding to float32 turns the face that it turns most."""
    exact, rounded = (
        np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        for vertices in (triangles.vertices, triangles.vertices.astype(np.float32))
        for p in [vertices.astype(np.float64)[triangles.faces]]
    )
    lengths = np.linalg.norm(exact, axis=1) * np.linalg.norm(rounded, axis=1)
    sine = np.linalg.norm(np.cross(exact, rounded), axis=1) / lengths
    return float(np.degrees(np.arcsin(sine.max())))
