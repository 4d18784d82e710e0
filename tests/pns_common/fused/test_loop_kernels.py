"""Compiled Loop refinement has the bits of the array kernels, on any mesh."""

import sys

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, refine
from pns_common.fused import LARGEST_INDEX, fits, kernels_available
from pns_common.refine import kernels_can_serve
from tests.support.kernels import (
    assert_kernels_agree,
    assert_same_bits,
    by_arrays,
    by_kernels,
    edges_of,
)
from tests.support.meshes import bumpy_sphere, every_edge_class, manifolds, soups
from tests.support.shared import shared_path

SEEDS = st.integers(0, 2**32 - 1)
SHAPES = every_edge_class()


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


def test_kernels_agree_on_faces_without_area():
    vertices, faces = bumpy_sphere(2)
    vertices[5] = vertices[7]
    vertices[faces[3]] = vertices[faces[3][0]]
    assert_kernels_agree(Mesh(vertices, faces), levels=2)


def test_refine_takes_the_kernels_for_loop():
    assert kernels_available()
    mesh = Mesh(*bumpy_sphere(0))
    assert kernels_can_serve(mesh, loop(), 8, 1.0)
    made = refine(mesh, loop(), 2)
    assert made.mesh.vertices.tobytes() == by_arrays(mesh, 2).points.tobytes()


def test_numbers_that_do_not_fit_in_int32_are_left_to_the_arrays():
    assert fits(0, LARGEST_INDEX // 12, 1)
    assert not fits(0, LARGEST_INDEX // 12 + 1, 1)
    assert not fits(LARGEST_INDEX, 1, 1)
    mesh = Mesh(*bumpy_sphere(0))
    assert not kernels_can_serve(mesh, loop(), 16, 1.0)


def test_without_numba_the_arrays_serve(monkeypatch):
    mesh = Mesh(*bumpy_sphere(0))
    monkeypatch.setattr(sys.modules["pns_common.refine"], "kernels_available", lambda: False)
    assert not kernels_can_serve(mesh, loop(), 1, 1.0)
    assert refine(mesh, loop()).mesh.vertices.tobytes() == by_arrays(mesh, 1).points.tobytes()


def test_on_windows_the_arrays_serve(monkeypatch):
    """Machine code is called otherwise there, and nobody has seen these kernels run."""
    monkeypatch.setattr(sys, "platform", "win32")
    assert not kernels_available.__wrapped__()
    monkeypatch.undo()
    assert kernels_available.__wrapped__()
