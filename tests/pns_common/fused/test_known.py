"""Which schemes have kernels: all of a model's with features that these know."""

from dataclasses import replace

from pns_common import load_model, loop, pns
from pns_common.features.edge_features import FEATURE_SETS, paper_features
from pns_common.features.feature_set import FeatureSet
from pns_common.features.ring_features import RingFeatureSet
from pns_common.fused.known import kernels_know
from pns_common.runtimes.onnx_model import bundled_models
from pns_common.schemes import Scheme
from tests.support.networks import scale_free_model


def test_every_bundled_model_has_kernels():
    assert all(kernels_know(pns(load_model(name))) for name in bundled_models())


def test_schemes_without_kernels_are_left_to_the_arrays():
    known = pns(scale_free_model())
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


def test_a_feature_set_that_is_added_is_left_to_the_arrays(monkeypatch):
    """The kernels' columns are written out: of another set they wrote past its end."""
    known = pns(scale_free_model())
    edges = known.edge_rule
    added = FeatureSet("paper-6", (*paper_features.groups, paper_features.groups[0]))
    sets = {**FEATURE_SETS, added.name: added}
    monkeypatch.setattr("pns_common.fused.known.FEATURE_SETS", sets, raising=False)
    operator = replace(edges.operator, features=added)
    assert not kernels_know(replace(known, edge_rule=replace(edges, operator=operator)))


def test_rules_that_disagree_about_boundaries_are_left_to_the_arrays():
    with_one, without = (pns(scale_free_model(0, boundary_strength=b)) for b in (1.0, None))
    assert kernels_know(with_one)
    assert not kernels_know(replace(with_one, vertex_rule=without.vertex_rule))
