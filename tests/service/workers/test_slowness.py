"""The machine's speed is learnt from jobs that tell it, and from no single one."""

from __future__ import annotations

import pytest

from service.workers.costs import MOST, TELLING_SECONDS, Slowness


@pytest.mark.parametrize("factor", [0.25, 1.0, 3.0])
def test_it_comes_to_what_jobs_take_here(factor: float) -> None:
    slowness = Slowness()
    for predicted in (0.4, 2.0, 30.0) * 20:
        slowness.learn(predicted, predicted * factor)
    assert slowness.factor == pytest.approx(factor, rel=1e-3)


def test_one_file_that_was_predicted_a_thousandth_says_little_of_the_machine() -> None:
    slowness = Slowness()
    slowness.learn(0.06, 60.0)
    assert 1 < slowness.factor < 1.2
    for _ in range(1000):
        slowness.learn(0.06, 60.0)
    assert slowness.factor <= MOST


def test_what_is_over_at_once_says_nothing() -> None:
    slowness = Slowness()
    slowness.learn(5.0, TELLING_SECONDS)
    assert slowness.factor == 1
