"""The card of a model file: what it says is read back, and what it may not say is named."""

import json
from dataclasses import replace

import pytest

from pns_common.models.card import ModelCard
from tests.support.networks import CARD, SCALE_FREE_CARD, VERTEX_CARD


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"boundary_strength": -1.0}, "boundary_strength -1.0"),
        ({"learned_levels": 0}, "learned_levels 0"),
        ({"prior_strength": -0.5}, "prior_strength"),
        ({"prior_strength": 1e150}, "prior_strength 1e.150, not a number from 0 to 100"),
        ({"boundary_strength": 100.1}, "boundary_strength 100.1, not a number from 0 to 100"),
        ({"network_scale": 0.0}, "network_scale"),
        ({"fold_angle": 90.0}, "fold_angle"),
        ({"fold_angle": None}, "without fold_angle"),
        ({"format": 2}, "learned_levels in format 2"),
        ({"side_gates": 1}, "side_gates of type int"),
        ({"network_altitudes": 0.0}, "network_altitudes 0.0, not a finite number > 0"),
        ({"tip_strength": -0.1}, "tip_strength -0.1, not a number from 0 to 100"),
        ({"even_prior_strength": -1.0}, "even_prior_strength -1.0, not a number from 0 to 100"),
        ({"crease_prior": 1}, "crease_prior of type int"),
        ({"crease_prior": True}, "crease_prior without a boundary_strength"),
        ({"crease_angle": 180.0}, "crease_angle 180.0, not between 0 and 180 degrees"),
        ({"crease_angle": 0.0}, "crease_angle 0.0"),
        ({"crease_angle": 66.0}, "one of crease_angle and crease_levels without the other"),
        ({"crease_angle": 66.0, "crease_levels": 0}, "crease_levels 0, not at least 1"),
    ],
)
def test_a_wrong_number_on_a_card_is_named(changes, says):
    with pytest.raises(ValueError, match=says):
        ModelCard.from_json(json.dumps(json.loads(SCALE_FREE_CARD.to_json()) | changes))


def test_a_card_reads_back_as_it_was_written():
    thin = replace(
        SCALE_FREE_CARD,
        side_gates=True,
        boundary_strength=1.0,
        network_altitudes=3.0,
        wide_bound=True,
        crease_prior=True,
        tip_strength=0.9,
        even_prior_strength=1.2,
        crease_angle=66.0,
        crease_levels=2,
    )
    for card in (CARD, VERTEX_CARD, SCALE_FREE_CARD, thin):
        assert ModelCard.from_json(card.to_json()) == card


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"format": 1}, "vertex fields in format 1, not 2"),
        ({"vertex_gate_sharpness": None}, "without the other"),
        ({"vertex_features": "ring-99"}, "vertex_features 'ring-99', not one of ring-10"),
        ({"vertex_gate_sharpness": 0}, "vertex_gate_sharpness 0, not a finite number > 0"),
    ],
)
def test_a_wrong_vertex_field_is_named(changes, says):
    with pytest.raises(ValueError, match=says):
        ModelCard.from_json(json.dumps(json.loads(VERTEX_CARD.to_json()) | changes))


def test_what_is_not_there_is_left_out_and_order_is_that_of_the_attributes():
    keys = list(json.loads(CARD.to_json()))
    assert keys == [
        *("format", "features", "gate_sharpness", "budget", "orientation", "training", "metrics")
    ]


def test_a_whole_number_will_do_for_a_float_and_a_truth_value_will_not():
    values = json.loads(CARD.to_json())
    assert ModelCard.from_json(json.dumps(values | {"budget": 2})).budget == 2
    with pytest.raises(ValueError, match="budget of type bool"):
        ModelCard.from_json(json.dumps(values | {"budget": True}))
