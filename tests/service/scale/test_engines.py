"""Where tasks are done: the same bytes on Ray, and what cannot be started is told."""

import os
import signal

import pytest

from service.errors import InvalidParameter, WorkerDied
from service.options import Limits
from service.scale import engines
from service.scale.batch import batch_work
from service.scale.engines import Work, local, on_ray
from service.scale.job import Task
from tests.service.scale.jobs import begins_at_once, ends_at_once, process_of
from tests.service.scale.libraries import LOOP, batch_of, hashes, library, refined


@pytest.mark.filterwarnings("ignore")
def test_ray_makes_the_same_bytes(tmp_path, monkeypatch):
    # A busy machine starts its daemons slowly.
    monkeypatch.setenv("RAY_raylet_start_wait_time_s", "300")
    pytest.importorskip("ray", reason="the extra [ray] is not installed")
    library(tmp_path / "in", ["a.obj", "b/c.obj"])
    refined(batch_of(tmp_path))
    over = batch_of(tmp_path, destination=str(tmp_path / "ray"), report=tmp_path / "ray.jsonl")
    assert refined(over, on_ray(batch_work(60.0), None, 1)).counts == {"done": 2}
    assert hashes(tmp_path / "ray") == hashes(tmp_path / "out")


def tasks(count):
    return (Task(f"{k}", "", "obj", "obj", LOOP, None, Limits()) for k in range(count))


def never(task, error):
    raise AssertionError(task, error)


def test_a_worker_that_is_killed_between_two_tasks_costs_nothing(monkeypatch):
    monkeypatch.setattr(engines, "prepare", begins_at_once)
    processes = []
    for process in local(Work(process_of, never, 1, None), 2)(tasks(5)):
        processes.append(process)
        os.kill(process, signal.SIGKILL)
    assert len(set(processes)) == 5


def test_workers_that_never_begin_are_told(monkeypatch):
    monkeypatch.setattr(engines, "prepare", ends_at_once)
    monkeypatch.setattr(engines, "MOST_BROKEN", 2)
    with pytest.raises(WorkerDied, match="2 workers ended"):
        list(local(Work(process_of, never, 1, None), 1)(tasks(1)))


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
    assert engines._connected(ray, None, 1) == "connected"
    assert ray.calls == [None, "shutdown", None, "shutdown", None]


@pytest.mark.parametrize(
    ("address", "errors", "words"),
    [
        (None, [SLOW] * 3, "timed out"),
        (None, [Exception("no room")], "no room"),
        (None, [RuntimeError("no port")], "no port"),
        ("a:1", [ConnectionError("refused")], "a:1: no cluster answers"),
    ],
)
def test_a_cluster_that_cannot_be_had_is_told(address, errors, words):
    with pytest.raises(InvalidParameter, match=words):
        engines._connected(Ray(*errors), address, 1)
