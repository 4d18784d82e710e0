"""Where a gate is shut nothing is added whatever the network says, so it is not asked."""

import sys

import numpy as np
import pytest

from pns_common import Mesh, load_model, pns, refine
from pns_common.errors import ModelError
from pns_common.formula.correction import checked_answer
from pns_common.fused import load_kernels
from tests.support.meshes import grid
from tests.support.networks import scale_free_model

# The last is what the others take it from when they are first imported.
WHERE = (
    "pns_common.fused.learned.edge_rule",
    "pns_common.fused.learned.vertex_rule",
    "pns_common.formula.vertex_operator",
    "pns_common.formula.correction",
)
MODELS = {
    "paper": load_model("paper"),
    "signed": load_model("signed"),
    "format 3": scale_free_model(0),
    "format 3, sides": scale_free_model(3, 20.0, side_gates=True),
}


def half_flat():
    return Mesh(*grid(10, lambda x, y: np.maximum(x, 0) ** 2 * (1 + y)))


class Asked:
    """A model that counts its rows."""

    def __init__(self, model):
        self.model, self.card, self.name, self.hash = model, model.card, model.name, model.hash
        self.rows = 0

    def __call__(self, features, budget):
        self.rows += len(features)
        assert len(features) > 0
        return self.model(features, budget)

    def vertex_correction(self, features, budget):
        self.rows += len(features)
        assert len(features) > 0
        return self.model.vertex_correction(features, budget)


@pytest.fixture(params=["arrays", "kernels"])
def engine(request, monkeypatch):
    if request.param == "arrays":
        monkeypatch.setattr(sys.modules["pns_common.refine"], "kernels_available", lambda: False)
    elif not load_kernels():
        pytest.skip("no compiler for kernels")


@pytest.mark.parametrize("name", MODELS)
def test_a_shut_gate_leaves_the_network_out_and_every_number_as_it_was(name, engine, monkeypatch):
    model = Asked(MODELS[name])
    made = refine(half_flat(), pns(model))
    asked, level = model.rows, made.report["levels"][0]
    for module in WHERE:
        monkeypatch.setattr(f"{module}.where_open", ask_for_all)
    whole = refine(half_flat(), pns(model))
    np.testing.assert_array_equal(made.mesh.vertices, whole.mesh.vertices)
    np.testing.assert_array_equal(made.ratio, whole.ratio)
    np.testing.assert_array_equal(made.gate, whole.gate)
    assert made.report == whole.report
    assert level["shut"] == (model.rows - asked) - asked
    assert asked < 0.75 * (model.rows - asked)


def ask_for_all(network, features, gate, like):
    return checked_answer(network(features), like)


def test_a_plane_asks_no_network_at_all(engine):
    model = Asked(MODELS["format 3, sides"])
    refine(Mesh(*grid(5, lambda x, y: 0 * x)), pns(model))
    assert model.rows == 0


def test_what_is_not_finite_is_refused_where_a_gate_is_open(engine):
    class Broken(Asked):
        def __call__(self, features, budget):
            return np.full((len(features), 3), np.nan)

    with pytest.raises(ModelError, match="finite"):
        refine(half_flat(), pns(Broken(MODELS["paper"])))
