"""What counts as a model, and as one with a network for old vertices."""

from pns_common import load_model
from pns_common.models.protocol import Model, VertexModel
from tests.support.networks import CARD, Float64Model, random_layers


class Nameless:
    card, hash = CARD, "0" * 64

    def __call__(self, features, budget):
        return features[:, :3]


def test_a_model_has_a_card_a_name_a_hash_and_answers():
    assert isinstance(load_model("paper"), Model)
    assert isinstance(Float64Model(random_layers(0)), Model)
    assert not isinstance(Nameless(), Model)
    assert not isinstance("paper", Model)


def test_a_vertex_model_answers_for_vertices_too():
    class Two(Float64Model):
        def vertex_correction(self, features, budget):
            return features[:, :3]

    assert isinstance(Two(random_layers(0)), VertexModel)
    assert not isinstance(Float64Model(random_layers(0)), VertexModel)
