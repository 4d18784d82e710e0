"""One level is README's formula, read edge by edge and vertex by vertex with nothing of ours."""

from dataclasses import replace
from math import tanh

import numpy as np
import pytest

from pns_common import pns
from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import signed_features
from pns_common.features.ring_features import RING_10
from pns_common.geometry.rings import ring_vectors
from pns_common.levels.step import level_step
from pns_common.rules.control_level import control_level
from tests.support.meshes import bumpy_sphere
from tests.support.networks import SCALE_FREE_CARD, VERTEX_CARD, float64_network, random_layers
from tests.support.plain_operator import PlainMesh, shortened

POINTS, FACES = bumpy_sphere(4, subdivisions=0, bump=0.3)
VERTICES, R = range(len(POINTS)), 0.7
LEVEL = control_level(POINTS, build_topology(FACES, len(POINTS)), reference_length=R)
EDGES = LEVEL.topology.edges.tolist()
PLAIN = PlainMesh(POINTS, FACES)
PUSHES = [PLAIN.push(v) for v in VERTICES]
AT_EDGES = np.array([PLAIN.edge_features(a, b) for a, b in EDGES])
AT_VERTICES = np.array([PLAIN.ring_features(v) for v in VERTICES])
# So that gates are half open, and the budget binds at some edges and vertices and not at others.
GATES = {"gate_sharpness": 3.0, "vertex_gate_sharpness": 2.0}
FORMAT_3 = replace(SCALE_FREE_CARD, **GATES, budget=0.3, prior_strength=0.8)
FORMAT_2 = replace(VERTEX_CARD, **GATES, budget=0.3)


class Model:
    """Two networks in double precision under a card."""

    name, hash = "two networks", "0" * 64

    def __init__(self, card):
        self.card = card
        self.at_edges = float64_network(random_layers(0, (18, 8, 3), 0.5))
        self.at_vertices = float64_network(random_layers(1, (10, 8, 3), 0.5))

    def __call__(self, features, budget):
        return budget * self.at_edges(features)

    def vertex_correction(self, features, budget):
        return budget * self.at_vertices(features)


def plain_edge(card, a, b, answer):
    """q."""
    bound = PLAIN.longest_side(a, b) if card.wide_bound else PLAIN.length(a, b, None)
    gate = tanh(card.gate_sharpness * PLAIN.jump(a, b) ** 2)
    asked = np.transpose(PLAIN.frame(a, b)) @ answer
    longest = card.budget / R * bound**2
    if card is FORMAT_2:
        return PLAIN.loop_edge(a, b, POINTS) + gate * longest * asked
    if card.side_gates:
        gate += (1 - gate) * PLAIN.side_gate(a, b, card.vertex_gate_sharpness)
    prior = card.prior_strength * PLAIN.loop_edge(a, b, PUSHES)
    asked = prior + card.network_scale * PLAIN.length(a, b, card.network_altitudes) * asked
    return PLAIN.loop_edge(a, b, POINTS) + gate * shortened(asked, longest)


def plain_vertex(card, v, answer):
    """p'."""
    spoke_length = PLAIN.spoke_length(v)
    gate = tanh(card.vertex_gate_sharpness * PLAIN.mean_jump[v])
    asked = answer @ np.array(PLAIN.ring_vectors(v))
    longest = card.budget / R * spoke_length**2
    if card is FORMAT_2:
        return PLAIN.loop_vertex(v, POINTS) + gate * longest * shortened(asked, 1)
    prior = card.prior_strength * PLAIN.loop_vertex(v, PUSHES)
    if card.tip_strength:
        prior = PLAIN.kept_at_tip(v, prior, PUSHES, card.tip_strength)
    asked = prior + card.network_scale * PLAIN.length_at(v, card.network_altitudes) * asked
    return PLAIN.loop_vertex(v, POINTS) + gate * shortened(asked, longest)


CARDS = {
    "format 2": FORMAT_2,
    "format 3": FORMAT_3,
    "sides": replace(FORMAT_3, side_gates=True),
    "tips": replace(FORMAT_3, tip_strength=0.7),
    "thin faces": replace(FORMAT_3, network_altitudes=1.1, wide_bound=True, budget=0.15),
}


@pytest.mark.parametrize("card", CARDS.values(), ids=CARDS)
def test_a_level_is_the_formula(card):
    model = Model(card)
    step = level_step(LEVEL, replace(pns(model), guard=None))
    answers = zip(EDGES, model.at_edges(AT_EDGES), strict=True)
    edges = [plain_edge(card, a, b, answer) for (a, b), answer in answers]
    answers = zip(VERTICES, model.at_vertices(AT_VERTICES), strict=True)
    vertices = [plain_vertex(card, v, answer) for v, answer in answers]
    np.testing.assert_allclose(step.edges.positions, edges, rtol=0, atol=1e-13)
    np.testing.assert_allclose(step.vertices.positions, vertices, rtol=0, atol=1e-13)
    if card.format == 3:
        ratios = np.concatenate([step.edges.ratio, step.vertices.ratio])
        gates = np.concatenate([step.edges.gate, step.vertices.gate])
        bound = np.isclose(ratios, gates)
        assert bound.any()
        assert not bound.all()
        assert 0.2 < np.median(gates) < 0.9


def test_what_the_networks_read_is_as_it_is_defined():
    """docs/features.md."""
    rows = signed_features.fields(LEVEL.rings)
    operator = pns(Model(FORMAT_3)).edge_rule.operator
    stencil = operator.stencil(POINTS, LEVEL.normals, rows, LEVEL.topology, np.arange(len(EDGES)))
    seen = signed_features(stencil, operator.orientation.frames(stencil))
    np.testing.assert_allclose(seen, AT_EDGES, rtol=0, atol=1e-13)
    np.testing.assert_allclose(RING_10(LEVEL.rings), AT_VERTICES, rtol=0, atol=1e-13)
    expected = [PLAIN.ring_vectors(v) for v in VERTICES]
    np.testing.assert_allclose(ring_vectors(LEVEL.rings), expected, rtol=0, atol=1e-13)
