"""Budgets of faces a minute."""

from __future__ import annotations

import pytest

from service.workers.budget import FacesBudget, OverBudgetError


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_minutes_worth_is_there_at_once_and_refills_evenly() -> None:
    clock = Clock()
    budget = FacesBudget(clock)
    budget.charge("a", 60, 60)
    with pytest.raises(OverBudgetError) as refusal:
        budget.charge("a", 30, 60)
    assert (refusal.value.status, refusal.value.code) == (429, "over-budget")
    assert refusal.value.retry_after == 31
    # Another client has its own.
    budget.charge("b", 60, 60)
    clock.now = 30
    budget.charge("a", 30, 60)
    with pytest.raises(OverBudgetError):
        budget.charge("a", 1, 60)


def test_a_job_larger_than_a_minute_runs_once_and_leaves_a_debt() -> None:
    clock = Clock()
    budget = FacesBudget(clock)
    budget.charge("a", 180, 60)
    clock.now = 119
    with pytest.raises(OverBudgetError):
        budget.charge("a", 1, 60)
    clock.now = 122
    budget.charge("a", 1, 60)


def test_a_job_is_paid_for_by_what_it_made() -> None:
    clock = Clock()
    budget = FacesBudget(clock)
    budget.charge("a", 10, 60)
    budget.settle("a", 40, 60)
    with pytest.raises(OverBudgetError, match="10 of 60"):
        budget.charge("a", 11, 60)


def test_what_was_not_made_is_given_back() -> None:
    clock = Clock()
    budget = FacesBudget(clock)
    budget.charge("a", 20, 60)
    budget.charge("a", 40, 60)
    budget.settle("a", -40, 60)
    with pytest.raises(OverBudgetError, match="40 of 60"):
        budget.charge("a", 41, 60)
    # After a minute nothing was used: that is no credit.
    clock.now = 60
    budget.settle("a", -20, 60)
    budget.charge("a", 60, 60)
    with pytest.raises(OverBudgetError):
        budget.charge("a", 1, 60)


def test_no_budget_is_no_limit() -> None:
    budget = FacesBudget(Clock())
    budget.charge("a", 10**12, None)
    budget.settle("a", -(10**12), None)


def test_strangers_are_forgotten_once_they_owe_nothing() -> None:
    clock = Clock()
    budget = FacesBudget(clock)
    for number in range(10_000):
        budget.charge(f"{number}", 1, 60)
    clock.now = 100
    budget.charge("last", 1, 60)
    budget.charge("one more", 1, 60)
    assert len(budget._used) < 10


def test_who_owes_something_is_not_forgotten_for_a_richer_client() -> None:
    clock = Clock()
    budget = FacesBudget(clock)
    budget.charge("poor", 60, 60)
    for number in range(10_000):
        budget.charge(f"{number}", 1, 60)
    clock.now = 6
    budget.charge("rich", 1, 10**6)
    with pytest.raises(OverBudgetError, match="6 of 60"):
        budget.charge("poor", 60, 60)
