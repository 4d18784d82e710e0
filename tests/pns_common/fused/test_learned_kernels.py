"""Compiled learned levels have the bits of the array kernels: every format, guard and report."""

import sys
from dataclasses import fields, replace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ModelError, load_model, loop, pns, refine
from pns_common.blocks import Blocks
from pns_common.creases import with_creases
from pns_common.edge.feature_set import FeatureSet
from pns_common.fused import load_kernels
from pns_common.fused.known import kernels_know
from pns_common.fused.level import control_level
from pns_common.onnx_model import bundled_models
from pns_common.schemes import Scheme
from pns_common.topology import Topology, build_topology
from pns_common.vertex.rings import RingFeatureSet
from tests.support.kernels import (
    assert_kernels_agree,
    assert_same_bits,
    by_arrays,
    by_kernels,
    edges_of,
)
from tests.support.meshes import (
    bent,
    bow_tie,
    bumpy_sphere,
    grid,
    manifolds,
    one_way_pair,
    soups,
    three_pages,
)
from tests.support.networks import (
    SCALE_FREE_CARD,
    VERTEX_CARD,
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
    "format 3, no budget": pns(scale_free_model(), budget=0.0),
}
SHAPES = {
    "closed": bumpy_sphere(0),
    "open": grid(6, bent),
    "bow-tie": bow_tie(),
    "three pages": three_pages(),
    "one-way pair": one_way_pair(),
    "isolated vertex": (np.vstack([grid(3)[0], [[9, 9, 9]]]), grid(3)[1]),
}
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


@pytest.mark.parametrize("name", ["paper", "signed", "full", "general"])
@pytest.mark.parametrize("asset", ["spot_control_mesh.obj", "Fox.glb", "moebius.obj"])
def test_kernels_agree_for_bundled_models_on_real_meshes(name, asset):
    loaded = trimesh.load(shared_path("assets") / asset, force="mesh", process=False)
    mesh = Mesh(loaded.vertices, loaded.faces)
    assert_kernels_agree(mesh, 1, scheme=pns(load_model(name)))


@given(soups() | manifolds(), SEEDS)
def test_a_levels_topology_is_the_array_kernels(mesh, seed):
    creases = edges_of(mesh, 3, seed)
    level = control_level(mesh.vertices, mesh.faces, creases, Blocks(1))
    expected = with_creases(build_topology(mesh.faces, len(mesh.vertices)), creases)
    compiled = level.topology()
    for field in fields(Topology):
        assert np.array_equal(getattr(compiled, field.name), getattr(expected, field.name)), (
            field.name
        )


def test_every_bundled_model_has_kernels():
    assert all(kernels_know(pns(load_model(name))) for name in bundled_models())


def test_the_guard_takes_rounds_and_both_ways_take_the_same():
    mesh = Mesh(*bumpy_sphere(3, bump=0.5))
    scheme = SCHEMES["format 3, guarded hard"]
    made, free = by_kernels(mesh, 1, scheme=scheme), replace(scheme, guard=None)
    assert not np.array_equal(made.points, by_kernels(mesh, 1, scheme=free).points)
    assert_kernels_agree(mesh, 1, scheme=scheme)


class Broken:
    """A model whose network for edges or for vertices returns NaN."""

    name, hash = "broken", "0" * 64

    def __init__(self, card, edges, vertices):
        self.card, self.edges, self.vertices = card, edges, vertices

    def __call__(self, features, budget):
        return np.full((len(features), 3), self.edges)

    def vertex_correction(self, features, budget):
        return np.full((len(features), 3), self.vertices)


@pytest.mark.parametrize("card", [VERTEX_CARD, SCALE_FREE_CARD])
@pytest.mark.parametrize(("edges", "vertices"), [(np.nan, 0.0), (0.0, np.inf)])
def test_what_a_network_may_not_return_is_refused(card, edges, vertices):
    with pytest.raises(ModelError, match="finite"):
        by_kernels(Mesh(*bumpy_sphere(0)), 1, scheme=pns(Broken(card, edges, vertices)))


def test_schemes_without_kernels_are_left_to_the_arrays():
    known = SCHEMES["format 3"]
    assert kernels_know(known)
    edges, vertices = known.edge_rule, known.vertex_rule
    other = FeatureSet("other", edges.operator.features.groups[:1])
    assert not kernels_know(
        replace(known, edge_rule=replace(edges, operator=replace(edges.operator, features=other)))
    )
    rings = RingFeatureSet("other", (), lambda rings: rings.mean_jump)
    strange = replace(vertices, operator=replace(vertices.operator, features=rings))
    assert not kernels_know(replace(known, vertex_rule=strange))
    assert not kernels_know(replace(known, vertex_rule=lambda level: vertices(level)))
    assert not kernels_know(Scheme("by hand", loop().vertex_rule, loop().edge_rule))


def with_boundary_rule(mesh):
    card = replace(SCALE_FREE_CARD, boundary_strength=1.0)
    scheme = pns(Broken(card, 0.3, 0.2))
    return by_arrays(mesh, 2, scheme=scheme), by_kernels(mesh, 2, scheme=scheme)


def test_a_boundary_rule_changes_nothing_where_there_is_no_boundary():
    assert_same_bits(*with_boundary_rule(Mesh(*bumpy_sphere(1))))


def test_a_boundary_rule_has_the_same_bits_where_there_is_one():
    sphere = Mesh(*bumpy_sphere(1))
    assert_same_bits(*with_boundary_rule(Mesh(sphere.vertices, sphere.faces[2:])))


def test_refine_takes_the_kernels_for_models(monkeypatch):
    mesh, scheme = Mesh(*bumpy_sphere(0)), SCHEMES["format 3"]
    module = sys.modules["pns_common.refine"]
    monkeypatch.setattr(module, "refine_arrays", None)  # cannot be called
    assert load_kernels()
    made = refine(mesh, scheme, 2, reference_length=1.0)
    assert made.mesh.vertices.tobytes() == by_arrays(mesh, 2, scheme=scheme).points.tobytes()
