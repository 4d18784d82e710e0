"""Tallies add up to the whole in any order: counts, largest values and exact sums."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns
from pns_common.pieces.tally import LevelTally, Summed, reduced_report
from tests.support.meshes import bumpy_sphere
from tests.support.networks import scale_free_model
from tests.support.pieces import pieces_refined

RATIOS = st.lists(st.floats(0, 1.000001), max_size=30)


def test_tallies_cross_to_a_file_and_back():
    mesh = Mesh(*bumpy_sphere(1, 1))
    (made,) = pieces_refined(mesh, np.zeros(len(mesh.faces), int), pns(scale_free_model(0)), 2, 1.0)
    for tally in made.refined.tallies:
        assert LevelTally.of_dict(tally.as_dict()) == tally


@given(RATIOS, st.integers(0, 30))
def test_sums_of_parts_are_the_sum_of_all_to_the_last_bit(values, cut):
    values = np.array(values)
    whole = Summed.of(values)
    assert Summed.of(values[:cut]) + Summed.of(values[cut:]) == whole
    assert Summed.of(values[::-1]) == whole
    assert whole.mean == pytest.approx(values.mean() if len(values) else 0.0, abs=2.0**-40)
    assert (whole.largest, whole.active) == (values.max(initial=0), np.sum(values > 0.01))


def test_more_numbers_than_one_sum_of_steps_could_hold_add_up():
    many = Summed.of(np.full(2**13 + 3, 2.0**10))
    assert many.steps == (2**13 + 3) * 2**50
    assert many.mean == 2**10


LEARNED = LevelTally(
    vertices=10,
    faces=16,
    edges=(20, 4, 1, 0),
    flipped_faces=1,
    chord=2.0,
    learned=True,
    displacement=0.5,
    envelope=3.0,
    shut=2,
    guarded=1,
)
OTHER = LevelTally(
    vertices=5,
    faces=8,
    edges=(9, 0, 0, 2),
    chord=1.0,
    learned=True,
    displacement=0.75,
    envelope=2.0,
    shut=1,
    guarded=4,
)


def test_a_report_adds_counts_and_takes_the_largest():
    report = reduced_report([[LEARNED], [OTHER]])
    assert report == reduced_report([[OTHER], [LEARNED]])
    (level,) = report["levels"]
    assert level["edges"] == {"interior": 29, "boundary": 4, "irregular": 1, "crease": 2}
    assert (level["vertices"], level["faces"], level["flipped_faces"]) == (15, 24, 1)
    assert (level["shut"], level["guarded"]) == (3, 5)
    assert level["normal_jump_max"] == pytest.approx(np.pi / 2)
    assert (report["limit_distance"], report["limit_distance_bound"]) == (0.75, 3.0)
    assert "vertex_rule" not in level


def test_one_piece_without_a_bound_leaves_the_whole_without():
    unbound = LevelTally(vertices=1, faces=4, edges=(1, 0, 0, 0), learned=True)
    report = reduced_report([[LEARNED], [unbound]])
    assert report["limit_distance_bound"] is None
    assert report["levels"][0]["envelope_max"] is None
    assert "guarded" not in report["levels"][0]


def test_levels_of_loop_have_no_distance():
    loop = LevelTally(vertices=1, faces=4, edges=(3, 0, 0, 0))
    report = reduced_report([[LEARNED, loop], [OTHER, loop]])
    assert report["learned_levels"] == 1
    assert "displacement_max" not in report["levels"][1]
