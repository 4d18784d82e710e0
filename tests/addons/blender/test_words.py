"""Sentences of the interface."""

from addons.blender.pns_refine import words

LEVEL = {"proximity_ratio": {"max": 0.5}, "flipped_faces": 0}
REPORT = {"scheme": "pns", "model": "general", "budget": 0.8, "levels": [LEVEL, LEVEL]}
REPORT |= {"limit_distance": 0.5, "limit_distance_bound": 2.0}


def certificate(**changed):
    return " ".join(words.certificate(REPORT | changed, 0.25, lambda x: f"{1000 * x:g} mm"))


def test_the_certificate_names_distance_share_and_folds():
    text = certificate()
    parts = "2 levels", "model general", "C = 0.8", "250 mm", "500 mm", "allow 2000 mm", "50 %"
    assert all(part in text for part in parts)
    assert "No face is flipped" in text
    text = certificate(levels=[LEVEL | {"flipped_faces": 3}])
    assert "3 faces are flipped" in text
    assert "1 level of" in text
    assert certificate(scheme="loop") == "2 levels of Loop, without correction"
    goal = certificate(adaptive={"faces": 5000, "distance_max": 0.001})
    assert "5,000 faces where the surface bends, by PNS" in goal
    assert "than 1 mm" in goal


def test_long_lists_are_cut():
    assert words.listed(["a", "b"]) == "a, b"
    assert words.listed(list("abcdef")) == "a, b, c, d and 2 more"
