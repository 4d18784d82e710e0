"""Totals over several meshes, by hand."""

import pytest

from service.report import total_level


def level(weight, ratio, gate, **edges):
    return {
        "vertices": 10 * weight,
        "faces": 20 * weight,
        "edges": {"interior": weight, "boundary": 1, "irregular": 2, **edges},
        "degenerate_frames": weight,
        "flipped_faces": 3,
        "proximity_ratio": dict(zip(("max", "mean", "p99"), ratio, strict=True)),
        "gate": dict(zip(("mean", "max", "active"), gate, strict=True)),
        "normal_jump_max": ratio[0],
    }


def test_counts_add_means_weigh_and_the_largest_wins():
    total = total_level(
        [level(1, (0.9, 0.4, 0.8), (0.1, 0.5, 0.2)), level(3, (0.7, 0.2, 0.3), (0.3, 0.9, 0.6))]
    )
    assert total["vertices"] == 40
    assert total["faces"] == 80
    assert total["edges"] == {"interior": 4, "boundary": 2, "irregular": 4}
    assert (total["degenerate_frames"], total["flipped_faces"]) == (4, 6)
    assert total["proximity_ratio"] == pytest.approx({"max": 0.9, "mean": 0.25, "p99": 0.8})
    assert total["gate"] == pytest.approx({"mean": 0.25, "max": 0.9, "active": 0.5})
    assert total["normal_jump_max"] == 0.9


def test_creases_add_where_there_are_some():
    ones = (0.0, 0.0, 0.0)
    total = total_level(
        [level(1, ones, ones, crease=4), level(1, ones, ones), level(0, ones, ones, crease=5)]
    )
    assert total["edges"]["crease"] == 9
