"""Options of a request beside the scheme: creases, smooth UVs, a weld tolerance."""

import numpy as np
import pytest

from pns_common import load_model
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.service.gltf.subdivided import subdivide
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron


def cylinder(sides=8):
    """A prism with smooth sides and flat ends: two closed rings of hard edges."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points, normals, faces = [], [], []
    for z in (-1.0, 1.0):
        points.append(np.column_stack([ring, np.full(sides, z)]))
        normals.append(np.column_stack([ring, np.zeros(sides)]))
    step, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces += [np.stack([step, after, after + sides], axis=1)]
    faces += [np.stack([step, after + sides, step + sides], axis=1)]
    for number, z in enumerate((-1.0, 1.0)):
        start = (2 + number) * sides + number
        points += [np.column_stack([ring, np.full(sides, z)]), [[0, 0, z]]]
        normals += [np.tile([0, 0, z], (sides + 1, 1))]
        fan = np.stack([step + start, after + start, np.full(sides, start + sides)], axis=1)
        faces += [fan if z > 0 else fan[:, ::-1]]
    shape = {"POSITION": np.concatenate(points), "NORMAL": np.concatenate(normals)}
    return shape | {"indices": np.concatenate(faces)}


@pytest.mark.parametrize("crease", ["normals", "angle:60"])
@pytest.mark.parametrize("scheme", ["loop", "pns"])
def test_creases_of_a_prism_keep_its_ends_flat(crease, scheme):
    result = subdivide([cylinder()], crease=crease, scheme=scheme, levels=2)
    counts = [level["edges"] for level in result.report["levels"]]
    assert [count["crease"] for count in counts] == [16, 32]
    assert result.report["meshes"][0]["levels"][0]["edges"]["crease"] == 16
    soft = subdivide([cylinder()], scheme=scheme, levels=2)
    for glb, flat in ((result.glb, True), (soft.glb, False)):
        faces, attributes = files.primitive_of(glb)
        ends = attributes["POSITION"][faces[16 * 16 :]]
        assert (np.abs(ends[..., 2]) == 1).all() == flat
    assert "crease" not in subdivide([cylinder()]).report["levels"][0]["edges"]


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({"scheme": "pns"}, 12),
        ({"scheme": "pns", "crease": "off"}, 0),
        ({"scheme": "pns", "budget": 0.0}, 0),
        ({"scheme": "loop"}, 0),
    ],
)
def test_sharp_edges_are_kept_where_the_model_asks(options, count):
    given = [[box()], [box()]]  # two meshes, which are refined together
    result = subdivide_gltf(files.glb(*given), "glb", Options(**options), load_model(), Limits())
    for mesh in result.report["meshes"]:
        assert mesh["levels"][0]["edges"].get("soft", 0) == count
    _, attributes = files.primitive_of(result.glb)
    reach = np.abs(attributes["POSITION"]).max(axis=1)
    assert np.allclose(reach, 1, atol=1e-3) == (count > 0)


def test_smooth_normals_and_absent_ones_make_no_crease():
    smooth = octahedron(NORMAL=octahedron()["POSITION"])
    for shape in (smooth, octahedron()):
        assert "crease" not in subdivide([shape], crease="normals").report["levels"][0]["edges"]


@pytest.mark.parametrize(
    ("shape", "crease", "smooth"),
    [(box(), "off", True), (box(), "auto", False), (cylinder(), "off", False)],
)
def test_flat_shading_goes_where_no_edge_is_to_stay_sharp(shape, crease, smooth):
    _, attributes = files.primitive_of(subdivide([shape], [shape], crease=crease).glb)
    points, normals = attributes["POSITION"].round(4), attributes["NORMAL"].round(4)
    several = len(np.unique(np.hstack([points, normals]), axis=0)) > len(np.unique(points, axis=0))
    assert several != smooth


def test_the_tip_of_a_cone_makes_no_creases():
    # Each side has its own normal at the tip, and shares those along the base.
    sides = 6
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    tips = np.tile([0.0, 0, 1], (sides, 1))
    middle = angle + np.pi / sides
    normals = np.concatenate([ring, np.column_stack([np.cos(middle), np.sin(middle), 0 * middle])])
    faces = [[k, (k + 1) % sides, sides + k] for k in range(sides)]
    cone = {"POSITION": np.concatenate([ring, tips]), "NORMAL": np.add(normals, [0, 0, 0.5])}
    report = subdivide([cone | {"indices": np.array(faces)}], crease="normals").report
    assert report["levels"][0]["edges"] == {"interior": 6, "boundary": 6, "irregular": 0}


def test_creases_cross_primitives():
    shape = cylinder()
    halves = [
        {**shape, "indices": shape["indices"][:16]},
        {**shape, "indices": shape["indices"][16:]},
    ]
    report = subdivide(halves, crease="normals").report
    assert report["levels"][0]["edges"]["crease"] == 16


@pytest.mark.parametrize("meshes", [1, 3])
@pytest.mark.parametrize("levels", [1, 3])
@pytest.mark.parametrize("crease", ["normals", "angle:60"])
def test_smooth_uvs_have_the_creases_of_the_positions(crease, levels, meshes):
    # Small meshes of a file are refined together.
    shapes = [cylinder(sides) for sides in (7, 8, 12)[:meshes]]
    for shape in shapes:
        shape["TEXCOORD_0"] = shape["POSITION"][:, 1:]
    result = subdivide(*([shape] for shape in shapes), uv="smooth", crease=crease, levels=levels)
    assert result.report["levels"][0]["edges"]["crease"] > 0
    for mesh in range(meshes):
        _, attributes = files.primitive_of(result.glb, mesh)
        np.testing.assert_allclose(
            attributes["TEXCOORD_0"], attributes["POSITION"][:, 1:], atol=1e-6
        )


def test_a_weld_tolerance_closes_what_does_not_quite_meet():
    flat = octahedron()["indices"].reshape(-1)
    noise = 1e-5 * np.random.default_rng(0).standard_normal((24, 3))
    loose = {"POSITION": octahedron()["POSITION"][flat] + noise}
    assert subdivide([loose]).report["levels"][0]["edges"]["boundary"] == 24
    result = subdivide([loose], weld_tolerance=1e-3)
    assert result.report["levels"][0]["edges"]["boundary"] == 0
    assert result.report["changes"] == [
        {
            "pointer": "/meshes/0",
            "code": "joined",
            "what": "vertices joined within weld_tolerance",
            "count": 18,
        }
    ]
    # It is relative to R: a mesh a million times larger is welded alike.
    large = {"POSITION": 1e6 * loose["POSITION"]}
    assert subdivide([large], weld_tolerance=1e-3).report["changes"] == result.report["changes"]
