"""The contract of a model file in itself: what goes in and out, and the card."""

import pytest

from pns_common import ModelError
from pns_common.models.contract import answer_to, check_interface, feature_inputs, read_card
from tests.support.networks import CARD, VERTEX_CARD

FEATURES, BUDGET = ("features", "FLOAT", ["*", 5]), ("budget", "FLOAT", [])
ANSWER = ("correction", "FLOAT", ["*", 3])


def test_each_input_of_features_has_its_answer():
    assert feature_inputs(CARD) == [("features", 5)]
    assert feature_inputs(VERTEX_CARD) == [("features", 18), ("vertex_features", 10)]
    assert answer_to("features") == "correction"
    assert answer_to("vertex_features") == "vertex_correction"


def test_inputs_may_stand_in_any_order():
    check_interface([BUDGET, FEATURES], [ANSWER], CARD, "good")


@pytest.mark.parametrize(
    ("inputs", "outputs", "says"),
    [
        ([FEATURES], [ANSWER], "inputs"),
        ([FEATURES, ("budget", "DOUBLE", [])], [ANSWER], "inputs"),
        ([("features", "FLOAT", ["*", 6]), BUDGET], [ANSWER], "inputs"),
        ([FEATURES, BUDGET], [], "outputs"),
        ([FEATURES, BUDGET], [("correction", "FLOAT", [7, 3])], "outputs"),
    ],
)
def test_what_goes_in_or_out_otherwise_is_told(inputs, outputs, says):
    with pytest.raises(ModelError) as refusal:
        check_interface(inputs, outputs, CARD, "other.onnx")
    assert refusal.value.path == "other.onnx"
    assert refusal.value.expected.startswith(says)


def test_there_is_one_card():
    assert read_card([CARD.to_json()], "good") == CARD
    for texts in ([], [CARD.to_json()] * 2):
        with pytest.raises(ModelError, match="one metadata entry") as refusal:
            read_card(texts, "bad")
        assert refusal.value.found == str(len(texts))
    with pytest.raises(ModelError, match="of format 1 or 2 or 3"):
        read_card(["{}"], "bad")
