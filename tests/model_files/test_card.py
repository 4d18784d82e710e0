"""A card is read back as it was written, and a wrong one is refused by name."""

import json
from dataclasses import fields

import pytest

from pns_common.model.card import NEEDED, ModelCard
from tests.support.networks import CARD, DEFAULT_CARD


def changed(card, **changes):
    """A card as JSON with some fields changed; None leaves a field out."""
    values = json.loads(card.to_json()) | changes
    return json.dumps({name: value for name, value in values.items() if value is not None})


@pytest.mark.parametrize("card", [CARD, DEFAULT_CARD], ids=["1", "5"])
def test_a_card_reads_back_as_it_was_written(card):
    assert ModelCard.from_json(card.to_json()) == card


def test_format_1_knows_no_field_of_format_5():
    assert list(json.loads(CARD.to_json())) == [
        *("format", "features", "gate_sharpness", "budget", "orientation", "training", "metrics")
    ]


def test_the_default_has_at_most_ten_fields_more_and_a_sentence_for_each():
    assert max(map(len, NEEDED.values())) <= 10
    described = {
        line.split(":")[0].strip() for line in ModelCard.__doc__.splitlines() if ": " in line
    }
    assert {field.name for field in fields(ModelCard)} <= described


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        # Retired ones are refused by name before anything else.
        *(({"format": n, "x": 1}, f"format {n}, which is not read any more") for n in (2, 3, 4)),
        ({"tip_strength": 1.0}, "unknown fields tip_strength"),
        ({"format": 6}, "format 6"),
        ({"format": "5"}, "format 5"),
        ({"format": None}, "format None"),
        ({"base": "doo-sabin"}, "base 'doo-sabin', not one of loop, catmull-clark"),
        ({"features": "paper-5"}, "features 'paper-5' in format 5"),
        ({"orientation": "left"}, "orientation 'left', not one of first-face, symmetric"),
        ({"gate_sharpness": 0.0}, "gate_sharpness 0.0, not a finite number > 0"),
        ({"vertex_gate_sharpness": -1}, "vertex_gate_sharpness -1.0, not a finite number > 0"),
        ({"budget": 0}, "budget 0.0, not a finite number > 0"),
        ({"budget": 10**400}, "budget with more digits than a float holds"),
        ({"budget": True}, "budget of type bool"),
        ({"network_scale": 0.0}, "network_scale 0.0, not a finite number > 0"),
        ({"boundary_strength": -0.5}, "boundary_strength -0.5, not a number from 0 to 100"),
        ({"boundary_strength": 1e150}, "boundary_strength 1e.150, not a number from 0 to 100"),
        ({"boundary_strength": 100.1}, "boundary_strength 100.1, not a number from 0 to 100"),
        ({"fold_angle": 90.0}, "fold_angle 90.0, not between 0 and 90 degrees"),
        ({"sharpness_levels": 17}, "sharpness_levels 17, not from 0 to 16"),
        ({"sharpness_levels": 1.5}, "sharpness_levels of type float"),
        ({"training": []}, "training of type list"),
        ({"metrics": None}, "missing fields metrics"),
        ({"width": 9}, "width 9, not even, from 2 to 128"),
        ({"rounds": 0}, "rounds 0, not from 1 to 8"),
        *(({name: None}, f"missing field {name} in format 5") for name in sorted(NEEDED[5])),
    ],
)
def test_a_wrong_field_is_named(changes, says):
    with pytest.raises(ValueError, match=says):
        ModelCard.from_json(changed(DEFAULT_CARD, **changes))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "Expecting"),
        ("[]", "not an object"),
        ('{"format": NaN}', "no number"),
        ("[" * 100_000, "nested"),
    ],
)
def test_what_is_no_object_of_json_is_refused(text, says):
    with pytest.raises(ValueError, match=says):
        ModelCard.from_json(text)
