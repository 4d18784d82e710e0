"""Compiled learned levels have the bits of the array kernels: every format, guard and report."""

import sys

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, load_model, pns, refine
from pns_common.fused import load_kernels
from tests.support.kernels import (
    assert_kernels_agree,
    assert_same_bits,
    by_arrays,
    by_kernels,
    edges_of,
)
from tests.support.meshes import bumpy_sphere, every_edge_class, manifolds, soups
from tests.support.networks import (
    random_model,
    scale_free_model,
    vertex_model,
)
from tests.support.shared import shared_path

SCHEMES = {
    "format 1": pns(random_model(0, scale=30.0)),
    "format 2": pns(vertex_model()),
    "format 3": pns(scale_free_model()),
    "format 3, the prior alone": pns(scale_free_model(scale=0)),
    "format 3, two learned levels": pns(scale_free_model(learned_levels=2)),
    "format 3, guarded hard": pns(scale_free_model(fold_angle=2.0)),
    "format 3, boundaries too": pns(scale_free_model(boundary_strength=1.0, learned_levels=2)),
    "format 3, boundaries guarded hard": pns(
        scale_free_model(boundary_strength=1.0, fold_angle=3.0)
    ),
    "format 3, side gates": pns(scale_free_model(side_gates=True, boundary_strength=1.0)),
    "format 3, side gates, tight": pns(scale_free_model(side_gates=True), budget=0.3),
    "format 3, thin faces": pns(scale_free_model(network_altitudes=1.5, wide_bound=True)),
    "format 3, thin faces, tight": pns(
        scale_free_model(network_altitudes=0.4, side_gates=True, boundary_strength=1.0), budget=0.3
    ),
    "format 3, wide bound, tight": pns(scale_free_model(wide_bound=True), budget=0.3),
    "format 3, tips": pns(scale_free_model(tip_strength=0.8)),
    "format 3, curves and tips": pns(
        scale_free_model(
            boundary_strength=1.0, crease_prior=True, tip_strength=1.3, learned_levels=2
        )
    ),
    "format 3, creases, tight": pns(
        scale_free_model(boundary_strength=1.0, crease_prior=True, fold_angle=3.0), budget=0.3
    ),
    "format 3, no budget": pns(scale_free_model(), budget=0.0),
}
SHAPES = every_edge_class()
SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("shape", SHAPES)
def test_kernels_agree_on_every_edge_class(scheme, shape):
    mesh = Mesh(*SHAPES[shape])
    assert_kernels_agree(mesh, 3, scheme=SCHEMES[scheme])
    assert_kernels_agree(mesh, 2, edges_of(mesh, 3, 0), SCHEMES[scheme])


@given(soups(), SEEDS, st.sampled_from(list(SCHEMES)), st.sampled_from([1e-3, 1.0, 100.0]))
def test_kernels_agree_on_any_faces_over_any_points(mesh, seed, scheme, length):
    assert_kernels_agree(mesh, 2, edges_of(mesh, 3, seed), SCHEMES[scheme], length)


@given(manifolds(), st.sampled_from(list(SCHEMES)), st.sampled_from([1e-3, 1.0, 100.0]))
def test_kernels_agree_on_manifolds(mesh, scheme, length):
    assert_kernels_agree(mesh, 2, None, SCHEMES[scheme], length)


@given(soups() | manifolds(), st.integers(1, 4), st.sampled_from(list(SCHEMES)))
def test_bits_do_not_depend_on_threads(mesh, threads, scheme):
    divided = by_kernels(mesh, 2, scheme=SCHEMES[scheme], threads=threads, rows=7)
    assert_same_bits(divided, by_kernels(mesh, 2, scheme=SCHEMES[scheme]))


@pytest.mark.parametrize("name", ["paper", "signed", "general"])
@pytest.mark.parametrize("asset", ["spot_control_mesh.obj", "Fox.glb", "moebius.obj"])
def test_kernels_agree_for_bundled_models_on_real_meshes(name, asset):
    loaded = trimesh.load(shared_path("assets") / asset, force="mesh", process=False)
    mesh = Mesh(loaded.vertices, loaded.faces)
    assert_kernels_agree(mesh, 1, scheme=pns(load_model(name)))


def test_refine_takes_the_kernels_for_models(monkeypatch):
    mesh, scheme = Mesh(*bumpy_sphere(0)), SCHEMES["format 3"]
    module = sys.modules["pns_common.refine"]
    monkeypatch.setattr(module, "refine_arrays", None)  # cannot be called
    assert load_kernels()
    made = refine(mesh, scheme, 2, reference_length=1.0)
    assert made.mesh.vertices.tobytes() == by_arrays(mesh, 2, scheme=scheme).points.tobytes()
