"""advice: why little changed, and the option that changes it."""

from __future__ import annotations

import numpy as np
import pytest

from pns_common import loop
from service.gltf.subdivide import subdivide_gltf
from service.meshfiles.convert import as_flags, converted
from service.meshfiles.mesh_file import of_triangles
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.options import Limits, Options
from tests.service.gltf.test_options import cylinder
from tests.support.gltf.files import glb
from tests.support.gltf.shapes import box, octahedron

CUBE = "12 of 12 bent edges are kept sharp: use crease=off to round all of them"


def advice(*meshes, **options):
    chosen = Options(**{"scheme": "loop"} | options)
    return subdivide_gltf(glb(*meshes), "glb", chosen, None, Limits()).report["advice"]


def test_a_cube_of_sharp_edges_says_how_it_gets_round():
    # A quad's diagonal does not bend.
    assert advice([box()], crease="angle:60") == [CUBE]


def test_a_shape_that_gets_round_says_nothing():
    assert advice([box()], crease="off") == []
    # Two rims of eight are sharp; the eight sides are not.
    (line,) = advice([cylinder()], crease="angle:60")
    assert line.startswith("16 of 24 ")
    assert advice([cylinder()], crease="angle:100") == []


def test_an_angle_is_offered_that_keeps_at_most_half():
    # A cube's 12 edges bend by 90 degrees, an octahedron's 12 by 70.5.
    (line,) = advice([box()], [octahedron()], crease="angle:60")
    assert line == (
        "24 of 24 bent edges are kept sharp: "
        "use crease=angle:80, which keeps 12, for a rounder shape"
    )


def test_who_rounds_all_is_warned_of_gaps_where_pieces_have_borders():
    shape = box()
    opened = {"POSITION": shape["POSITION"], "indices": np.reshape(shape["indices"], -1)[6:]}
    (line,) = advice([opened], crease="angle:60")
    assert line.endswith("use crease=off to round all of them; gaps may open where pieces touch")


@pytest.mark.parametrize("alone", [False, True])
def test_the_meshes_of_a_file_count_together(alone, monkeypatch):
    if alone:
        monkeypatch.setattr("service.gltf.refine.meshes.MOST_FACES", -1)
    assert advice([box()], [box()], crease="angle:60") == [CUBE.replace("12", "24")]
    # All of an octahedron's edges bend, and by 70 degrees.
    assert advice([box()], [octahedron()], crease="angle:80") == [CUBE.replace("of 12", "of 24")]
    assert advice([box()], *[[octahedron()]] * 4, crease="angle:80") == []


def test_triangles_that_share_no_vertex_say_how_to_join_them():
    shape = octahedron()
    corners = shape["POSITION"][np.reshape(shape["indices"], -1)].astype(np.float64)
    apart = corners + 1e-5 * np.arange(len(corners))[:, None]
    (line,) = advice([{"POSITION": apart.astype(np.float32), "indices": np.arange(24)}])
    assert line.startswith("24 of 24 edges are open borders")
    assert "weld_tolerance=" in line


def test_a_flat_sheet_says_that_it_is_flat():
    sheet = {
        "POSITION": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32),
        "indices": np.array([0, 1, 2, 2, 1, 3]),
    }
    (line,) = advice([sheet])
    assert line.startswith("the shape is flat")


@pytest.mark.parametrize("faces", ["f 1 2 3", "f 1 2 3 4", "f 1 2 3 4 5"])
@pytest.mark.parametrize("count", [1, 2])
def test_only_faces_that_have_others_are_to_be_joined(faces, count):
    corners = [(0, 0), (2, 0), (2, 2), (1, 3), (0, 2)]
    lines = [f"v {x + 9 * k} {y} 0" for k in range(count) for x, y in corners]
    lines += [faces, faces.translate(str.maketrans("12345", "6789X")).replace("X", "10")][:count]
    options = Options(scheme="loop" if faces == "f 1 2 3" else "catmull-clark")
    made = converted("\n".join(lines).encode(), "obj", "obj", options, None, Limits())
    (line,) = made.report["advice"]
    assert ("weld_tolerance" in line) == (count == 2)


def test_mesh_files_say_the_same_and_the_command_spells_its_own_options():
    cube = box()
    triangles = of_triangles(
        cube["POSITION"].astype(np.float64), np.reshape(cube["indices"], (-1, 3))
    )
    chosen = Options(scheme="loop", crease="angle:60")
    _, report = refine_mesh_file(triangles, loop(), chosen, Limits())
    assert report["advice"] == [CUBE]
    assert as_flags(report["advice"][0]) == CUBE.replace("crease=", "--crease ")
