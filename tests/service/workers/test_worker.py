"""The one door for jobs leaves nothing behind it."""

import gc
import weakref

import pytest

from pns_common.model import session
from service.errors import GltfError
from service.meshfiles.convert import converted
from service.options import Limits, Options
from service.workers import jobs, worker


class Thing:
    """Holds itself, so that no count of references ends it."""

    def __init__(self):
        self.own = self


@pytest.mark.parametrize("fails", [False, True])
def test_what_a_job_leaves_in_cycles_is_gone_after_it(fails):
    left = []
    rare = []
    usual = gc.get_threshold()

    def job():
        left.append(weakref.ref(Thing()))
        rare.append(gc.get_threshold())
        if fails:
            raise ZeroDivisionError

    if fails:
        with pytest.raises(worker.JobFaultError):
            worker.call(job)
    else:
        worker.call(job)
    assert left[0]() is None
    assert rare[0][0] == worker.OBJECTS_A_SEARCH
    assert gc.get_threshold() == usual


class Held:
    """Something that a job holds, as a file or an array."""


@pytest.mark.parametrize("kind", [GltfError, ZeroDivisionError])
def test_a_refusal_holds_nothing_of_its_job(kind):
    """The error is kept until it is sent, and with its frames would keep what they hold."""
    left = []

    def job():
        held = Held()
        left.append(weakref.ref(held))
        try:
            {}["inner"]
        except KeyError as error:
            raise kind("refused") from error

    with pytest.raises((GltfError, worker.JobFaultError)) as caught:
        worker.call(job)
    assert left[0]() is None
    assert caught.value.__cause__ is None


@pytest.mark.parametrize("face", [b"f 1 2 3", b"f 1 2 3 4"])
def test_a_warm_worker_opens_no_network_in_its_first_job(face, monkeypatch):
    """It would be kept from then on: a worker would seem to grow."""
    jobs.warm_up(None)
    monkeypatch.setattr(session, "_open_session", None)
    mesh = b"v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 0\n" + face
    made = converted(mesh, "obj", "glb", Options(levels=1), jobs._MODELS.get(), Limits())
    assert made.report["model"] is not None
