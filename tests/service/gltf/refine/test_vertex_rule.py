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
