"""A model that moves old vertices too keeps all that the service promises of a file."""

import numpy as np
import pytest

from benchmarks.generated import torus
from benchmarks.memory import peak_mib, reset_peak
from pns_common import Mesh, load_model, loop, pns, refine
from service.errors import LimitError
from service.gltf.subdivide import subdivide_gltf
from service.meshes.weld import weld
from service.meshfiles.glb import triangles_glb
from service.meshfiles.mesh_file import of_triangles
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.options import Limits, Options
from tests.service.gltf.test_options import cylinder
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.networks import default_model, random_model

# Boundaries and creases are Loop's.
MODEL = default_model(boundary_strength=0.0, budget=0.5)


def subdivide(*meshes, model=MODEL, **options):
    options = Options(**{"scheme": "pns", "levels": 1, "crease": "off", **options})
    return subdivide_gltf(files.glb(*meshes), "glb", options, model, Limits())


def corners(result, name="POSITION"):
    """An attribute at the corners of all faces: the same in every numbering of the vertices."""
    faces, attributes = files.primitive_of(result.glb)
    return attributes[name][faces]


def departure(result, by_loop):
    """Return how far each corner of each face is from Loop's."""
    return np.linalg.norm(corners(result) - corners(by_loop).astype(np.float64), axis=-1)


def welded_octahedron():
    """Numbered as the service does it: the random networks see the order of vertices."""
    welded = weld(octahedron()["POSITION"], octahedron()["indices"])
    return Mesh(welded.points, welded.faces)


def is_old(faces, levels):
    """Return which corners of the refined faces are vertices of the level before the last."""
    # The children of a face begin with its three corners; the fourth has none of them.
    old = np.zeros((faces * 4**levels, 3), dtype=bool)
    old[:, 0] = np.arange(len(old)) % 4 < 3
    return old


def test_old_vertices_carry_their_own_ratio_and_gate():
    result = subdivide([octahedron()], diagnostics="full")
    expected = refine(welded_octahedron(), pns(MODEL), 1, creases=None)
    for name, values in (("_PNS_RATIO", expected.ratio), ("_PNS_GATE", expected.gate)):
        stored = corners(result, name)[..., 0]
        np.testing.assert_array_equal(stored, values.astype(np.float32)[expected.mesh.faces])
        assert (stored[is_old(8, 1)] > 0.01).all()
        assert stored.max() <= 1 + 1e-6
    by_edges = subdivide([octahedron()], model=random_model(0), diagnostics="full")
    assert not corners(by_edges, "_PNS_RATIO")[is_old(8, 1)].any()


def test_the_report_in_the_file_says_what_moved():
    result = subdivide([octahedron()], [box()], levels=2)
    tree, _ = files.unpack(result.glb)
    report = tree["asset"]["extras"]["pns"]
    assert report == result.report
    assert (report["model"], report["model_hash"]) == ("default", MODEL.hash)
    # Six vertices and eight, at the first level alone.
    assert report["levels"][0]["vertex_rule"]["vertices"] == 14
    for mesh, count in zip(report["meshes"], (6, 8), strict=True):
        assert mesh["levels"][0]["vertex_rule"]["vertices"] == count
        assert "vertex_rule" not in mesh["levels"][1]
    assert report["levels"][0]["vertex_rule"]["proximity_ratio"]["max"] > 0.01
    without = subdivide([octahedron()], model=random_model(0)).report
    assert "vertex_rule" not in without["levels"][0]


@pytest.mark.parametrize("crease", ["normals", "angle:60"])
def test_vertices_on_creases_are_where_loop_puts_them(crease):
    result = subdivide([cylinder()], crease=crease, levels=2, diagnostics="full")
    by_loop = subdivide([cylinder()], crease=crease, levels=2, scheme="loop")
    ends = np.abs(corners(by_loop)[..., 2]) == 1
    apart = departure(result, by_loop)
    assert not apart[ends].any()
    assert not corners(result, "_PNS_RATIO")[ends].any()
    # The smooth sides between them do move, old vertices and new ones.
    assert (apart[is_old(32, 2) & ~ends] > 1e-4).any()
    soft = subdivide([cylinder()], levels=2)
    assert departure(soft, subdivide([cylinder()], levels=2, scheme="loop"))[ends].any()


def test_every_vertex_of_a_creased_cube_stays():
    result = subdivide([box()], crease="angle:89", levels=2)
    assert result.report["levels"][0]["vertex_rule"]["vertices"] == 0
    assert not departure(
        result, subdivide([box()], crease="angle:89", levels=2, scheme="loop")
    ).any()


@pytest.mark.parametrize("levels", [1, 2])
def test_morph_targets_stay_loops_and_weight_zero_the_base_pose(levels):
    moved = {"POSITION": 0.3 * np.random.default_rng(0).standard_normal((6, 3))}
    result = subdivide([octahedron(targets=[moved])], levels=levels)
    np.testing.assert_array_equal(
        corners(result), corners(subdivide([octahedron()], levels=levels))
    )
    by_loop = subdivide([octahedron(targets=[moved])], levels=levels, scheme="loop")
    (ours,), (theirs,) = (files.targets_of(each.glb) for each in (result, by_loop))
    np.testing.assert_array_equal(ours["POSITION"], theirs["POSITION"])
    assert departure(result, by_loop)[is_old(8, levels)].all()


def test_skin_weights_are_those_of_loop():
    weights = np.random.default_rng(1).dirichlet(np.ones(3), 6)
    bound = octahedron(
        JOINTS_0=np.tile(np.uint8([2, 0, 1, 0]), (6, 1)),
        WEIGHTS_0=np.pad(weights, ((0, 0), (0, 1))),
    )
    result, by_loop = (subdivide([bound], levels=2, scheme=scheme) for scheme in ("pns", "loop"))
    for name in ("JOINTS_0", "WEIGHTS_0"):
        np.testing.assert_array_equal(corners(result, name), corners(by_loop, name))
    assert departure(result, by_loop)[is_old(8, 2)].all()


@pytest.mark.parametrize("uv", ["linear", "smooth"])
def test_texture_coordinates_are_those_of_loop(uv):
    shape = octahedron(TEXCOORD_0=np.random.default_rng(0).random((6, 2)))
    result, by_loop = (
        subdivide([shape], levels=2, uv=uv, scheme=scheme) for scheme in ("pns", "loop")
    )
    np.testing.assert_array_equal(corners(result, "TEXCOORD_0"), corners(by_loop, "TEXCOORD_0"))


def test_normals_are_those_of_the_surface_that_is_written():
    shape = octahedron(NORMAL=octahedron()["POSITION"])
    result = subdivide([shape], levels=3, budget=0.2)
    normals, points = corners(result, "NORMAL"), corners(result).astype(np.float64)
    flat = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    assert (np.einsum("fi,fci->fc", flat, normals) > 0).mean() > 0.95
    by_loop = subdivide([shape], levels=3, scheme="loop")
    assert np.abs(normals - corners(by_loop, "NORMAL")).max() > 0.01


def test_vertices_on_a_boundary_are_where_loop_puts_them():
    # Without one face, three vertices lie on a boundary and three have closed rings.
    shape = octahedron(indices=octahedron()["indices"][1:])
    result, by_loop = (subdivide([shape], scheme=scheme) for scheme in ("pns", "loop"))
    old = shape["indices"].reshape(-1)
    apart = departure(result, by_loop)[is_old(7, 1)]
    assert not apart[np.isin(old, octahedron()["indices"][0])].any()
    assert apart[np.isin(old, [1, 3, 5])].all()


def test_mesh_files_are_refined_by_the_same_rule():
    shape = octahedron()
    triangles = of_triangles(shape["POSITION"], shape["indices"])
    options = Options(levels=2, crease="off")
    refined, report = refine_mesh_file(triangles, pns(MODEL), options, Limits())
    expected = refine(welded_octahedron(), pns(MODEL), 2, creases=None)
    np.testing.assert_array_equal(
        refined.vertices[refined.faces], expected.mesh.vertices[expected.mesh.faces]
    )
    assert report["levels"][0]["vertex_rule"]["vertices"] == 6


def test_the_result_does_not_depend_on_the_number_of_threads():
    mesh = torus(70_000)
    alone, several = (refine(mesh, pns(MODEL), 1, threads=threads).mesh for threads in (1, 4))
    np.testing.assert_array_equal(alone.vertices, several.vertices)
    by_loop = refine(mesh, loop(), 1, threads=1).mesh.vertices
    assert (alone.vertices != by_loop)[: len(mesh.vertices)].any(axis=1).all()


@pytest.mark.parametrize(
    ("model", "options"),
    [(MODEL, Options()), (load_model(), Options(levels=2, diagnostics="full"))],
)
def test_memory_stays_below_what_was_predicted(model, options):
    mesh = torus(240_000 // 4**options.levels)
    data = triangles_glb(of_triangles(mesh.vertices, mesh.faces))
    small = files.glb([octahedron()])
    subdivide_gltf(small, "glb", options, model, Limits())  # imports, threads, the allocator
    with pytest.raises(LimitError) as refusal:
        subdivide_gltf(data, "glb", options, model, Limits(max_memory_bytes=2**20))
    reset_peak()
    before = peak_mib()
    subdivide_gltf(data, "glb", options, model, Limits())
    assert (peak_mib() - before) * 2**20 < refusal.value.found
