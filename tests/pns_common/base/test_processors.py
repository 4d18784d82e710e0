"""Threads leave the processor of the one they help, and are then free as before."""

import os
from threading import Event

import pytest

from pns_common.base import blocks, processors
from pns_common.base.blocks import Blocks
from pns_common.base.processors import current_processor, leave


@pytest.fixture
def moves(monkeypatch):
    """What a thread on processor 2 of 0, 2 and 5 asks to run on, in place of doing so."""
    asked = []
    monkeypatch.setattr(processors, "current_processor", lambda: 2)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 2, 5}, raising=False)
    monkeypatch.setattr(
        os, "sched_setaffinity", lambda of, where: asked.append((of, where)), raising=False
    )
    return asked


def test_a_thread_leaves_a_processor_and_may_come_back(moves):
    leave(2)
    assert moves == [(0, {0, 5}), (0, {0, 2, 5})]


@pytest.mark.parametrize("elsewhere", [0, -1])
def test_a_thread_that_is_elsewhere_stays(moves, elsewhere):
    leave(elsewhere)
    assert moves == []


def test_a_thread_stays_where_it_may_run_nowhere_else(moves, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {2}, raising=False)
    leave(2)
    assert set().union(*(where for _, where in moves)) == {2}


def test_a_sandbox_may_forbid_it(moves, monkeypatch):
    def forbidden(of, where):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setaffinity", forbidden, raising=False)
    leave(2)


def test_without_affinities_no_processor_is_known(monkeypatch):
    monkeypatch.delattr(os, "sched_setaffinity", raising=False)
    processors._of_this_thread.cache_clear()
    try:
        assert current_processor() == -1
    finally:
        processors._of_this_thread.cache_clear()


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinities here")
def test_a_thread_is_on_one_of_its_processors():
    assert current_processor() in os.sched_getaffinity(0)


def test_helpers_leave_the_callers_processor(monkeypatch):
    left, come = [], Event()

    def come_from(processor):
        left.append(processor)
        come.set()

    monkeypatch.setattr(blocks, "current_processor", lambda: 7)
    monkeypatch.setattr(blocks, "leave", come_from)
    Blocks(threads=3, rows=1).run(3, lambda _: come.wait(60))
    assert set(left) == {7}
