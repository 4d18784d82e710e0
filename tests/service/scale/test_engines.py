"""Engines: chunks of tasks, workers that die, clusters that cannot be had."""

import os
import signal
import sys
from types import SimpleNamespace

import pytest

from service.errors import InvalidParameter, WorkerDied
from service.scale.engines import local, on_ray
from service.scale.engines import work as chunks
from service.scale.engines.work import Work
from tests.service.scale.jobs import (
    Numbered,
    divides_by_zero,
    ends_at_once,
    hears_interrupts,
    process_of,
    third_dies,
)


def tasks(folder, count):
    return [Numbered(number, folder) for number in range(count)]


def never(task, error):
    raise AssertionError(task, error)


def blamed(task, _):
    return task.number, -task.attempt


def all_done(engine, given):
    return [result for results in engine(iter(given)) for result in results]


# Of six tasks in one chunk, whose fourth is to blame.
ALL_BUT_ONE = [(0, 1), (1, 1), (2, 1), (3, -2), (4, 1), (5, 1)]


def test_a_worker_that_is_killed_between_two_tasks_costs_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "MOST", 1)
    processes, killed = [], []
    take = local._Worker.take

    def killed_before(worker, chunk):
        """The one worker has nothing to do before each chunk: time to kill it."""
        if chunk[0].number == len(killed) + 1:
            killed.append(all_tasks[len(killed)].processes[-1])
            os.kill(killed[-1], signal.SIGKILL)
        take(worker, chunk)

    monkeypatch.setattr(local._Worker, "take", killed_before)
    all_tasks = tasks(tmp_path, 4)
    work = Work(process_of, never, None)
    for results in local.local(work, 1)(iter(all_tasks)):
        processes += results
    assert processes[:3] == killed
    assert len(set(processes)) == 4


def test_workers_that_never_begin_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(local, "MOST_BROKEN", 2)
    work = Work(process_of, never, None, ends_at_once)
    with pytest.raises(WorkerDied, match="2 workers ended"):
        list(local.local(work, 1)(iter(tasks(tmp_path, 1))))


def test_ctrl_c_is_the_driver_s_alone(tmp_path):
    """A terminal sends it to all; workers, also those that are starting, leave it alone."""
    work = Work(hears_interrupts, never, None)
    assert list(local.local(work, 1)(iter(tasks(tmp_path, 1)))) == [[False]]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_of_a_chunk_whose_worker_dies_the_task_it_was_at_is_to_blame(tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "FIRST", 6)
    given = tasks(tmp_path, 6)
    done = all_done(local.local(Work(third_dies, blamed, None), 1), given)
    assert sorted(done) == ALL_BUT_ONE
    assert [len(task.processes) for task in given[3:]] == [2, 1, 1]


def test_a_fault_of_a_task_is_raised_as_it_was(tmp_path):
    with pytest.raises(ZeroDivisionError):
        all_done(local.local(Work(divides_by_zero, never, None), 1), tasks(tmp_path, 1))


class TaskError(RuntimeError):
    """As Ray wraps what a task raised."""

    def as_instanceof_cause(self):
        return ZeroDivisionError("ours")


class Cluster:
    """Stands in for Ray, connected: does what it is sent when it is asked for it."""

    class exceptions:  # noqa: N801
        RayError = RuntimeError
        RayTaskError = TaskError

    is_initialized = staticmethod(lambda: True)
    cluster_resources = staticmethod(lambda: {"CPU": 1})

    def __init__(self):
        self.sent = []

    def remote(self, **_):
        def send(*arguments):
            self.sent.append(arguments)
            return len(self.sent) - 1

        return lambda function: SimpleNamespace(remote=lambda *given: send(function, *given))

    def wait(self, references, num_returns):
        return references[:num_returns], references[num_returns:]

    def get(self, reference):
        function, *given = self.sent[reference]
        return function(*given)


def test_of_a_chunk_that_a_cluster_loses_each_task_goes_alone(tmp_path, monkeypatch):
    def third_is_lost(task):
        if task.number == 3:
            raise Cluster.exceptions.RayError
        return task.number, task.attempt

    monkeypatch.setitem(sys.modules, "ray", Cluster())
    monkeypatch.setattr(chunks, "FIRST", 6)
    engine = on_ray.on_ray(Work(third_is_lost, blamed, None), None, 1)
    assert sorted(all_done(engine, tasks(tmp_path, 6))) == ALL_BUT_ONE


def test_a_fault_of_a_task_on_a_cluster_is_raised_as_it_was(tmp_path, monkeypatch):
    def breaks(task):
        raise Cluster.exceptions.RayTaskError

    monkeypatch.setitem(sys.modules, "ray", Cluster())
    engine = on_ray.on_ray(Work(breaks, never, None), None, 1)
    with pytest.raises(ZeroDivisionError, match="ours"):
        all_done(engine, tasks(tmp_path, 1))


def test_without_ray_its_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InvalidParameter, match=r"pns-subdivision\[ray\]"):
        on_ray.on_ray(Work(str, never, None), None, 1)


class Ray:
    """Stands in for the module: cannot be started, as often as it is told."""

    def __init__(self, *errors):
        self.errors, self.calls = list(errors), []

    def init(self, **settings):
        self.calls.append(settings["address"])
        if self.errors:
            raise self.errors.pop(0)
        return "connected"

    def shutdown(self):
        self.calls.append("shutdown")


SLOW = Exception("The current node timed out during startup. This could happen …")


def test_a_cluster_that_starts_slowly_is_started_again():
    ray = Ray(SLOW, SLOW)
    assert on_ray._connected(ray, None, 1) == "connected"
    assert ray.calls == [None, "shutdown", None, "shutdown", None]


@pytest.mark.parametrize(
    ("address", "errors", "words"),
    [
        (None, [SLOW] * 3, "timed out"),
        (None, [Exception("no room")], "no room"),
        (None, [RuntimeError("no port")], "no port"),
        ("a:1", [ConnectionError("refused")], "a:1: no cluster answers"),
        ("ray://a:1", [ImportError("it needs ray[client]")], r"ray://a:1: it needs ray\[client\]"),
    ],
)
def test_a_cluster_that_cannot_be_had_is_told(address, errors, words):
    with pytest.raises(InvalidParameter, match=words):
        on_ray._connected(Ray(*errors), address, 1)
