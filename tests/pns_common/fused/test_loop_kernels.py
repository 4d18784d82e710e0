"""Compiled Loop refinement has the bits of the array kernels, on any mesh."""

import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, MeshError, ParameterError, loop, refine
from pns_common.blocks import Blocks
from pns_common.fused import LARGEST_INDEX, fits, kernels_available
from pns_common.fused.extent import reference_length
from pns_common.fused.loop_points import largest_size
from pns_common.levels import check_coordinates
from pns_common.refine import kernels_can_serve, measure_reference_length
from tests.support.kernels import (
    assert_kernels_agree,
    assert_same_bits,
    by_arrays,
    by_kernels,
    edges_of,
)
from tests.support.meshes import (
    TETRAHEDRON,
    bent,
    bow_tie,
    bumpy_sphere,
    grid,
    manifolds,
    one_way_pair,
    soups,
    three_pages,
)
from tests.support.shared import shared_path

SEEDS = st.integers(0, 2**32 - 1)
SHAPES = {
    "closed": bumpy_sphere(0),
    "open": grid(6, bent),
    "bow-tie": bow_tie(),
    "three pages": three_pages(),
    "one-way pair": one_way_pair(),
    "isolated vertex": (np.vstack([grid(3)[0], [[9, 9, 9]]]), grid(3)[1]),
}


def cone(rim, apex=0, first=1):
    """Triangles that close around an apex."""
    ring = np.arange(first, first + rim)
    return np.stack([np.full(rim, apex), ring, np.roll(ring, -1)], axis=1)


@pytest.mark.parametrize("rims", [(3,), (3, 3), (3, 4), (6,), (5, 3, 3)])
@pytest.mark.parametrize("loose", [0, 1, 2])
def test_fans_that_close_around_one_vertex_are_told_apart(rims, loose):
    starts = 1 + np.cumsum([0, *rims])
    faces = [cone(rim, first=start) for rim, start in zip(rims, starts, strict=False)]
    # Triangles that hang on at the apex alone are fans too small to close.
    ends = starts[-1] + np.arange(2 * loose).reshape(loose, 2)
    # Before the others: a walk begins at a vertex's last corner.
    faces = np.concatenate([np.insert(ends, 0, 0, axis=1), *faces])
    points = np.random.default_rng(0).standard_normal((faces.max() + 1, 3))
    assert by_kernels(Mesh(points, faces), 1).several_fans == (len(rims) + loose > 1)
    assert_kernels_agree(Mesh(points, faces), 2)


@pytest.mark.parametrize("shape", SHAPES)
def test_kernels_agree_on_every_edge_class(shape):
    assert_kernels_agree(Mesh(*SHAPES[shape]), levels=3)


ASSETS = ["spot_control_mesh.obj", "penguin_control_mesh.obj", "fish_control_mesh.obj", "cow.glb"]


@pytest.mark.parametrize("name", [*ASSETS, "moebius.obj", "Fox.glb", "Knight.glb", "fuze.ply"])
@pytest.mark.parametrize("merge", [False, True])
def test_kernels_agree_on_real_meshes(name, merge):
    loaded = trimesh.load(shared_path("assets") / name, force="mesh", process=False)
    if merge:
        loaded.merge_vertices(merge_tex=True, merge_norm=True)
    assert_kernels_agree(Mesh(loaded.vertices, loaded.faces), levels=2)


@given(soups(), SEEDS)
def test_kernels_agree_on_any_faces_over_any_points(mesh, seed):
    assert_kernels_agree(mesh, levels=2)
    assert_kernels_agree(mesh, levels=2, creases=edges_of(mesh, 4, seed))


@given(manifolds(), SEEDS)
def test_kernels_agree_on_manifolds_with_creases(mesh, seed):
    assert_kernels_agree(mesh, levels=2)
    assert_kernels_agree(mesh, levels=3, creases=edges_of(mesh, 4, seed))


@given(soups() | manifolds(), st.integers(1, 4), st.integers(1, 9))
def test_bits_depend_neither_on_threads_nor_on_blocks(mesh, threads, rows):
    divided = by_kernels(mesh, 2, threads=threads, rows=rows)
    assert_same_bits(divided, by_kernels(mesh, 2))


def test_kernels_agree_where_all_corners_meet_in_one_hub():
    # The hub is the lower end of all its edges: chains would take k² / 2 steps.
    count = 400
    rim = np.stack([np.cos(np.arange(count)), np.sin(np.arange(count)), np.zeros(count)], axis=1)
    around = np.arange(1, count + 1)
    faces = np.stack([np.zeros(count, int), around, np.roll(around, -1)], axis=1)
    assert_kernels_agree(Mesh(np.vstack([[[0, 0, 1.0]], rim]), faces), levels=2)


@pytest.mark.parametrize("repeat", [[0, 1, 2], [1, 0, 2], [2, 0, 1]])
def test_kernels_agree_where_a_face_is_repeated_late(repeat):
    # Every edge of the repeated face is known by then, some of them more than twice.
    vertices, faces = bumpy_sphere(1, subdivisions=0)
    again = np.vstack([faces, faces[:1, repeat]])
    assert_kernels_agree(Mesh(vertices, again), levels=3)
    twice = np.vstack([faces, faces[3:8, repeat], faces[:6]])
    assert_kernels_agree(Mesh(vertices, twice), levels=2)


def test_kernels_agree_on_faces_without_area():
    vertices, faces = bumpy_sphere(2)
    vertices[5] = vertices[7]
    vertices[faces[3]] = vertices[faces[3][0]]
    assert_kernels_agree(Mesh(vertices, faces), levels=2)


@given(soups() | manifolds())
def test_the_reference_length_has_the_bits_of_the_arrays(mesh):
    assert reference_length(mesh.vertices, mesh.faces) == measure_reference_length(
        mesh.vertices, mesh.faces
    )


def test_the_reference_length_of_a_large_mesh_has_the_bits_of_the_arrays():
    points = np.random.default_rng(0).standard_normal((100_001, 3))
    faces = np.arange(99_999).reshape(-1, 3)
    assert reference_length(points, faces) == measure_reference_length(points, faces)


def test_a_crease_that_is_no_edge_is_refused():
    mesh = Mesh(np.random.default_rng(0).standard_normal((5, 3)), TETRAHEDRON)
    with pytest.raises(ParameterError, match="creases"):
        by_kernels(mesh, 1, creases=np.array([[0, 4]]))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.1e75])
def test_a_coordinate_out_of_range_is_found_in_any_block(bad):
    points = np.ones((100, 3))
    points[57, 2] = bad
    largest = largest_size(points, Blocks(2, rows=10))
    assert largest == abs(bad) or np.isnan(bad) == np.isnan(largest)
    with pytest.raises(MeshError, match="too large"):
        check_coordinates(largest)
    check_coordinates(largest_size(np.full((3, 3), -1e75), Blocks(1)))


def test_refine_takes_the_kernels_for_loop():
    assert kernels_available()
    mesh = Mesh(*bumpy_sphere(0))
    assert kernels_can_serve(mesh, loop(), 8, 1.0, None)
    made = refine(mesh, loop(), 2)
    assert made.mesh.vertices.tobytes() == by_arrays(mesh, 2).points.tobytes()


def test_numbers_that_do_not_fit_in_int32_are_left_to_the_arrays():
    assert fits(0, LARGEST_INDEX // 12, 1)
    assert not fits(0, LARGEST_INDEX // 12 + 1, 1)
    assert not fits(LARGEST_INDEX, 1, 1)
    mesh = Mesh(*bumpy_sphere(0))
    assert not kernels_can_serve(mesh, loop(), 16, 1.0, None)


def test_without_numba_the_arrays_serve(monkeypatch):
    mesh = Mesh(*bumpy_sphere(0))
    monkeypatch.setattr(sys.modules["pns_common.refine"], "kernels_available", lambda: False)
    assert not kernels_can_serve(mesh, loop(), 1, 1.0, None)
    assert refine(mesh, loop()).mesh.vertices.tobytes() == by_arrays(mesh, 1).points.tobytes()
