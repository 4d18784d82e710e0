"""A worker: a door that leaves nothing behind, memory files, and an end with its parent."""

import gc
import multiprocessing
import os
import select
import weakref
from pathlib import Path

import pytest

from pns_common.model import session
from service.errors import GltfError, NoStorageError
from service.meshfiles.convert import converted
from service.options import Limits, Options
from service.workers import jobs, memory_file, worker
from service.workers.memory_file import MemoryFile
from tests.support import orphans
from tests.support.stand_in_jobs import files_of_at_most


class Held:
    """Something that a job holds, as a file or an array; perhaps itself, in a cycle."""

    def __init__(self, of_itself=False):
        self.own = self if of_itself else None


@pytest.mark.parametrize("fails", [False, True])
def test_what_a_job_leaves_in_cycles_is_gone_after_it(fails):
    left, rare, usual = [], [], gc.get_threshold()

    def job():
        left.append(weakref.ref(Held(of_itself=True)))
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


def test_another_process_reads_and_fills_a_memory_file_by_its_name():
    with MemoryFile() as file:
        file.append(b"a body")
        assert Path(file.name).read_bytes() == b"a body"
        memory_file.write(file.name, b"short")
        assert b"".join(file.pieces()) == b"short"
        assert file.size == 5


def test_what_does_not_fit_is_refused_and_nothing_of_it_stays():
    with MemoryFile() as file:
        memory_file.write(file.name, b"before")
        with files_of_at_most(5000), pytest.raises(NoStorageError, match="10000 bytes"):
            memory_file.write(file.name, bytes(10_000))
        assert file.size == 0
        with files_of_at_most(5000), pytest.raises(NoStorageError):
            file.append(bytes(10_000))


@pytest.mark.parametrize("start", [orphans.serve, orphans.refine_a_library])
def test_a_worker_ends_with_a_parent_that_is_killed_also_inside_a_job(start, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    parent = multiprocessing.get_context("spawn").Process(target=start, args=(pipe,))
    parent.start()
    # Without waiting for a writer, whose process may have died.
    with os.fdopen(os.open(pipe, os.O_RDONLY | os.O_NONBLOCK), "rb", buffering=0) as told:
        assert select.select([told], [], [], 60)[0]
        assert told.read(5) == b"begun"
        parent.kill()
        parent.join()
        # Its end of the pipe is closed by nothing but its end.
        assert select.select([told], [], [], 30)[0]
        assert told.read(1) == b""
