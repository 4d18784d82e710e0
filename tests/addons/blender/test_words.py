"""Sentences of the interface."""

from addons.blender.pns_refine import words

LEVEL = {"proximity_ratio": {"max": 0.5}, "flipped_faces": 0}
REPORT = {"scheme": "pns", "model": "general", "budget": 0.8, "levels": [LEVEL, LEVEL]}
REPORT |= {"limit_distance": 0.5, "limit_distance_bound": 2.0}


def test_the_forecast_counts_faces():
    assert words.forecast(1000, 64_000) == "64,000 faces from 1,000"


def test_more_than_a_million_is_warned_of():
    assert words.too_many(1_000_000) is None
    assert "1,000,000" in words.too_many(1_000_001)


def test_the_certificate_names_distance_share_and_folds():
    text = " ".join(words.certificate(REPORT, 0.25, lambda x: f"{1000 * x:g} mm"))
    for part in (
        "2 levels",
        "model general",
        "C = 0.8",
        "250 mm",
        "500 mm",
        "allow 2000 mm",
        "50 %",
        "No face is flipped",
    ):
        assert part in text


def test_flipped_faces_are_not_kept_quiet():
    level = LEVEL | {"flipped_faces": 3}
    text = " ".join(words.certificate(REPORT | {"levels": [level]}, 0.0, str))
    assert "3 faces are flipped" in text
    assert "1 level of" in text


def test_loop_needs_no_certificate():
    assert words.certificate({"scheme": "loop", "levels": [LEVEL]}, 0.0, str) == [
        "1 level of Loop, without correction"
    ]


def test_long_lists_are_cut():
    assert words.listed(["a", "b"]) == "a, b"
    assert words.listed(list("abcdef")) == "a, b, c, d and 2 more"
