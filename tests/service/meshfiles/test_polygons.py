"""Polygons in, quads out: by Catmull–Clark, with all that corners and faces carry."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pns_common import Mesh, load_model, refine
from pns_common.operator.scheme import catmull_clark
from service.errors import InvalidParameter, UnrefinableError
from service.meshfiles import formats
from service.meshfiles.convert import Written, converted
from service.meshfiles.mesh_file import COLOUR, GROUP, MATERIAL, NORMAL, UV, MeshFile
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.flattened import flatten

CORNERS = [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
QUADS = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def cube(behind: str = "") -> bytes:
    """Six sides, each with texture coordinates of its own, of two materials and groups."""
    text = "mtllib no.mtl\n" + "".join(f"v {x} {y} {z} 1 0 0\n" for x, y, z in CORNERS)
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n" + behind
    for number, quad in enumerate(QUADS):
        text += f"usemtl m{number % 2}\ng g{number // 3}\n"
        text += "f " + " ".join(f"{v + 1}/{k + 1}" for k, v in enumerate(quad)) + "\n"
    return text.encode()


# The side at z = 1 is a group of its own.
TOPPED = cube().replace(b"usemtl m1\ng g0", b"usemtl m1\ng top", 1)


def made(data: bytes, kind: str, target: str, **options: Any) -> Written:
    given: dict[str, Any] = {"levels": 1} | options
    return converted(data, kind, target, Options(**given), None, Limits())


def quad_areas(mesh: MeshFile) -> np.ndarray:
    points = mesh.vertices[mesh.corners].reshape(-1, 4, 3)
    crosses = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
    return np.linalg.norm(crosses, axis=1) / 2


@pytest.mark.parametrize("target", ["obj", "ply", "off"])
@pytest.mark.parametrize("levels", [1, 2])
def test_quads_are_those_of_catmull_clark(target: str, levels: int) -> None:
    written = made(cube(), "obj", target, levels=levels)
    mesh = formats.read_polygons(written.content, target)
    wanted = refine(Mesh(np.array(CORNERS, float), np.array(QUADS)), catmull_clark(), levels).mesh
    assert written.report["scheme"] == "catmull-clark"
    assert written.faces == len(mesh.sizes) == 6 * 4**levels
    assert (mesh.sizes == 4).all()
    np.testing.assert_allclose(
        mesh.vertices[mesh.corners], wanted.vertices[wanted.faces.reshape(-1)], atol=1e-6
    )
    # Each side's coordinates stay a square of their own.
    uv = mesh.layers[UV].values[mesh.layers[UV].rows].reshape(6, -1, 2)
    steps = np.arange(2**levels + 1) / 2**levels
    grid = {(a, b) for a in steps for b in steps}
    assert all({tuple(row) for row in side} == grid for side in uv.round(9).tolist())
    assert (mesh.layers[COLOUR].values[mesh.layers[COLOUR].rows][:, 0] > 0).all()
    if target == "obj":
        for kind, names in ((MATERIAL, ("m0", "m1")), (GROUP, ("g0", "g1"))):
            label = mesh.labels[kind]
            assert label.names == names
            assert np.bincount(label.of_face).tolist() == [3 * 4**levels] * 2
        assert mesh.libraries == ("no.mtl",)


@pytest.mark.parametrize("compress", ["none", "meshopt"])
def test_a_glb_says_which_triangles_are_a_quad(compress: str) -> None:
    """FB_ngon_encoding: triangles of a polygon begin alike, those of the next one otherwise."""
    written = made(cube(), "obj", "glb", levels=2, compress=compress)
    tree, binary = files.unpack(written.content)
    assert tree["extensionsUsed"][0] == "FB_ngon_encoding"
    quads = 0
    for primitive in tree["meshes"][0]["primitives"]:
        assert primitive["extensions"]["FB_ngon_encoding"] == {}
        assert {"NORMAL", "TEXCOORD_0", "COLOR_0"} <= primitive["attributes"].keys()
        view = tree["bufferViews"][tree["accessors"][primitive["indices"]]["bufferView"]]
        if compress != "none":
            # A stream of triangles would turn their corners.
            assert view["extensions"]["EXT_meshopt_compression"]["mode"] == "INDICES"
            continue
        triangles = files.values_of(tree, binary, primitive["indices"]).reshape(-1, 3)
        first = triangles[:, 0]
        assert (first[::2] == first[1::2]).all()
        assert (first[1:-1:2] != first[2::2]).all()
        assert (triangles[::2, 2] == triangles[1::2, 1]).all()
        quads += len(triangles) // 2
    assert quads in (0, 96)
    assert tree["asset"]["extras"]["pns"]["totals"]["faces"] == 96


def test_draco_orders_triangles_anew_which_is_told() -> None:
    written = made(cube(), "obj", "glb", levels=1, compress="draco")
    tree, _ = files.unpack(written.content)
    assert "FB_ngon_encoding" not in tree["extensionsUsed"]
    for primitive in tree["meshes"][0]["primitives"]:
        assert primitive["extensions"].keys() == {"KHR_draco_mesh_compression"}
    told = [change["what"] for change in written.report["changes"]]
    assert sum("FB_ngon_encoding" in what for what in told) == 1


def test_seams_hard_edges_and_smoothing_groups_are_kept() -> None:
    hard = made(cube("s 1\n").replace(b"usemtl m1", b"s off\nusemtl m1"), "obj", "glb")
    tree, binary = files.unpack(hard.content)
    for primitive in tree["meshes"][0]["primitives"]:
        normals = files.values_of(tree, binary, primitive["attributes"]["NORMAL"])
        assert len(normals) == 3 * 9
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    round_ = made(cube(), "obj", "obj", normals="smooth", crease="angle:60", levels=2)
    mesh = formats.read_polygons(round_.content, "obj")
    assert np.abs(mesh.vertices).max() == 1
    normals = mesh.layers[NORMAL].values[mesh.layers[NORMAL].rows]
    assert (np.abs(np.abs(normals).max(axis=1) - 1) < 1e-6).all()


def test_each_scheme_takes_polygons_as_it_says() -> None:
    counts = {
        scheme: converted(
            cube(), "obj", "obj", Options(levels=1, scheme=scheme), load_model(), Limits()
        ).faces
        for scheme in ("auto", "pns", "loop", "catmull-clark")
    }
    assert counts == {"auto": 24, "pns": 24, "loop": 48, "catmull-clark": 24}
    triangles = made(cube(), "obj", "obj", scheme="loop").content
    assert made(triangles, "obj", "obj", scheme="catmull-clark").faces == 3 * 48
    glb = made(cube(), "obj", "glb").content
    assert made(glb, "glb", "glb", scheme="catmull-clark", polygons="auto").faces == 2 * 4 * 24
    with pytest.raises(InvalidParameter, match="catmull-clark"):
        made(glb, "glb", "glb", scheme="catmull-clark", material="m0")


@pytest.mark.parametrize("target", ["obj", "glb"])
def test_a_model_that_polygons_leave_out_is_named(target: str) -> None:
    def advice(scheme: Any, model: str) -> str:
        options = Options(levels=1, scheme=scheme)
        made = converted(cube(), "obj", target, options, load_model(model), Limits())
        return "\n".join(each["text"] for each in made.report["advice"])

    assert "model paper has no rules for polygons" in advice("auto", "paper")
    assert "scheme=pns" in advice("auto", "paper")
    for scheme, model in (("pns", "paper"), ("auto", "general"), ("catmull-clark", "paper")):
        assert "no rules for polygons" not in advice(scheme, model)


@pytest.mark.parametrize("target", ["obj", "ply", "off", "stl", "glb"])
@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("name", ["m1", "top"])
def test_chosen_polygons_are_refined_and_their_neighbours_stay_polygons(
    target: str, levels: int, name: str
) -> None:
    kind = MATERIAL if name == "m1" else GROUP
    given = formats.read_polygons(TOPPED, "obj")
    chosen, corners = given.labels[kind].named(name), given.corners.reshape(6, 4)
    full = formats.read_polygons(made(TOPPED, "obj", "obj", levels=levels).content, "obj")
    written = made(TOPPED, "obj", target, levels=levels, **{kind: name})
    if target == "glb":
        mesh, _ = flatten(written.content, "obj", Limits())
    else:
        mesh = formats.read_polygons(written.content, target)
    assert written.report["scheme"] == "catmull-clark"
    assert is_closed(mesh)
    still = {CORNERS[v] for v in np.setdiff1d(np.arange(8), corners[chosen])}
    assert {*CORNERS} & {*map(tuple, mesh.vertices.tolist())} == still
    if target in ("stl", "glb"):
        return
    wanted: list[Any] = []
    for face, own in enumerate(corners.tolist()):
        if chosen[face]:
            wanted += shown(full)[face * 4**levels : (face + 1) * 4**levels]
        else:
            beside = np.array([len({*own} & {*other}) == 2 for other in QUADS])
            length = 4 + int((beside & chosen).sum()) * (2**levels - 1)
            wanted.append([{CORNERS[v] for v in own} & still, *range(length - 1)])
    if target == "off":  # it lists faces by their size
        wanted.sort(key=len)
    for ring, expected in zip(shown(mesh), wanted, strict=True):
        assert len(ring) == len(expected)
        assert ring == expected if isinstance(expected, tuple) else expected[0] <= {*ring}
    if target == "obj":
        assert (mesh.sizes[mesh.labels[kind].named(name)] == 4).all()
        # A side's own coordinates: those of new corners lie evenly between its old ones.
        uv = mesh.layers[UV]
        for ring in np.split(uv.values[uv.rows], mesh.offsets[1:-1]):
            steps = np.abs(np.diff(np.vstack([ring, ring[:1]]), axis=0)).sum(axis=1)
            assert np.isin(steps.round(9), [2.0**-levels, 1]).all()
        assert len(uv.values) == len({*uv.rows.tolist()})


def rings(mesh: MeshFile) -> list[Any]:
    return np.split(mesh.corners, mesh.offsets[1:-1])


def shown(mesh: MeshFile) -> list[Any]:
    """Return where the corners of each face are."""
    return [tuple(map(tuple, mesh.vertices[ring].round(5).tolist())) for ring in rings(mesh)]


def is_closed(mesh: MeshFile) -> bool:
    """Tell whether each side, by positions, is there once in each direction."""
    _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = [place.reshape(-1)[ring].tolist() for ring in rings(mesh)]
    there = [side for face in faces for side in zip(face, face[1:] + face[:1], strict=True)]
    return len({*there}) == len(there) and {*there} == {(b, a) for a, b in there}


@pytest.mark.parametrize(
    ("normals", "limit"), [("keep", False), ("smooth", False), ("smooth", True)]
)
def test_normals_beside_chosen_polygons_are_those_of_what_is_left(
    normals: str, limit: bool
) -> None:
    outward = np.array(CORNERS) / 3**0.5
    text = "".join(f"vn {x} {y} {z}\n" for x, y, z in outward.tolist()) + TOPPED.decode()
    for quad in QUADS:
        plain = " ".join(f"{v + 1}/{k + 1}" for k, v in enumerate(quad))
        text = text.replace(plain, " ".join(f"{v + 1}/{k + 1}/{v + 1}" for k, v in enumerate(quad)))
    options: dict[str, Any] = {"normals": normals, "limit": limit}
    written = made(text.encode(), "obj", "obj", group="top", **options)
    mesh = formats.read_polygons(written.content, "obj")
    got = mesh.layers[NORMAL].values[mesh.layers[NORMAL].rows]
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1, atol=1e-6)
    points = mesh.vertices[mesh.corners]
    # They point away from the middle of a solid that is round, or was a cube.
    assert (np.einsum("ij,ij->i", got, points) > 0.5 * np.linalg.norm(points, axis=1)).all()
    at = (np.abs(points) == 1).all(axis=1)
    assert at.sum() == 4 * 3
    tolerance = 1e-6 if normals == "keep" else 0.3
    np.testing.assert_allclose(got[at], points[at] / 3**0.5, atol=tolerance)


@pytest.mark.parametrize("target", ["obj", "ply", "off", "stl", "glb"])
def test_choosing_all_polygons_is_refining_all(target: str) -> None:
    data = cube("s 1\n").replace(b"m1", b"m0")
    more: dict[str, Any] = {"uv": "smooth", "normals": "smooth", "crease": "angle:60"}
    for options in ({}, more):
        every = made(data, "obj", target, levels=2, **options)
        chosen = made(data, "obj", target, levels=2, material="m0", **options)
        assert chosen.content == every.content
        assert chosen.report == every.report


def test_a_choice_of_no_polygon_is_refused() -> None:
    with pytest.raises(UnrefinableError, match="m0, m1"):
        made(cube(), "obj", "obj", material="m2")
    with pytest.raises(UnrefinableError, match="three different"):
        made(cube() + b"usemtl thin\nf 1 2 2 1\n", "obj", "obj", material="thin")


def test_faces_that_are_none_are_dropped_and_reported() -> None:
    text = cube() + b"v 0 0 9\nf 1 1 2 2\nf 1 2 2 3 9\nf 4 5 6\n"
    report = made(text, "obj", "obj").report
    assert report["dropped"]["degenerate_faces"] == 1
    assert {
        "pointer": "",
        "code": "repeated-corners",
        "what": "repeated corners dropped",
        "count": 1,
    } in report["changes"]
    by_index = made(text, "obj", "obj", weld="index").report
    assert by_index["totals"]["faces"] == report["totals"]["faces"] == 24 + 4 + 3


@pytest.mark.parametrize("crease", ["off", "angle:60"])
def test_smooth_uvs_of_quads_follow_the_positions_and_their_creases(crease: str) -> None:
    """A closed chart whose coordinates are the positions'."""
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    text += "".join(f"vt {y} {z}\n" for _, y, z in CORNERS)
    for quad in QUADS:
        text += "f " + " ".join(f"{v + 1}/{v + 1}" for v in quad) + "\n"
    options = {"scheme": "catmull-clark", "uv": "smooth", "crease": crease, "levels": 3}
    mesh = formats.read_polygons(made(text.encode(), "obj", "obj", **options).content, "obj")
    uv = mesh.layers[UV].values[mesh.layers[UV].rows]
    np.testing.assert_allclose(uv, mesh.vertices[mesh.corners][:, 1:], atol=1e-9)


def test_a_concave_polygon_is_cut_before_it_is_refined() -> None:
    """A letter U, of area 30, whose texture coordinates and material stay."""
    outline = [(0, 0), (7, 0), (7, 6), (5, 6), (5, 2), (2, 2), (2, 6), (0, 6)]
    text = "usemtl brass\n" + "".join(f"v {x} {y} 0\nvt {x} {y}\n" for x, y in outline)
    text += "f " + " ".join(f"{k}/{k}" for k in range(1, 9)) + "\n"
    written = made(text.encode(), "obj", "obj", scheme="catmull-clark", border="fixed")
    told = {change["what"]: change["count"] for change in written.report["changes"]}
    assert told["concave polygons cut into convex pieces"] == 1
    mesh = formats.read_polygons(written.content, "obj")
    assert quad_areas(mesh).sum() == pytest.approx(30)
    uv = mesh.layers[UV]
    assert {*outline} <= {tuple(row) for row in uv.values[uv.rows].tolist()}
    assert mesh.labels[MATERIAL].names == ("brass",)
