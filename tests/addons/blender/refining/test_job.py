"""A job runs beside, tells how far it is, stops when told to, and hands on what went wrong."""

import threading

import pytest

from addons.blender.pns_refine.refining.job import Job, StoppedError


def test_the_answer_is_that_of_the_work():
    job = Job(lambda report: 42).start()
    assert job.answer() == 42
    assert job.share == 1
    assert not job.running


def test_cancelling_stops_at_the_next_report():
    started, go_on = threading.Event(), threading.Event()
    reached = []

    def work(report):
        report(0.25)
        started.set()
        go_on.wait()
        report(0.5)
        reached.append("the end")

    job = Job(work).start()
    started.wait()
    assert job.running
    assert job.share == 0.25
    job.cancel()
    go_on.set()
    with pytest.raises(StoppedError):
        job.answer()
    assert not reached


def test_errors_are_handed_on():
    def work(report):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        Job(work).start().answer()
