"""The numbers of the scale-free rule are those of a card, under the same names."""

from dataclasses import MISSING, fields

from pns_common.models.card import OPTIONAL_FIELDS, SCALE_FREE_FIELDS
from pns_common.rules.scale_free_form import ScaleFreeForm


def test_each_number_stands_on_a_card_and_the_optional_ones_are_optional_here():
    required = [field.name for field in fields(ScaleFreeForm) if field.default is MISSING]
    optional = [field.name for field in fields(ScaleFreeForm) if field.default is not MISSING]
    assert set(required) == {"budget", *SCALE_FREE_FIELDS}
    assert set(optional) == set(OPTIONAL_FIELDS)


def test_what_a_card_leaves_out_switches_nothing_on():
    form = ScaleFreeForm(1.0, 1.0, 0.4, 75.0, 1)
    assert not any(getattr(form, name) for name in OPTIONAL_FIELDS)
