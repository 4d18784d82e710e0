"""Jobs for the service's tests: each does one thing that a real job may do to its worker.

The request's body says what to do, so that one pool of workers serves all tests. Each worker that a
test starts imports this: it asks for nothing that takes long.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import resource
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from service.errors import GltfError, LimitError, NoModelError, UnreadableError
from service.options import Limits
from service.workers import memory_file
from service.workers.jobs import Done, Work, hold_model, job_memory
from service.workers.progress import PROGRESS

if TYPE_CHECKING:
    from pns_common.model.session import Model


def no_warm_up(model: object) -> None:
    pass


def hold_among(folder: str, model: Model | str | None) -> None:
    """Load a model, in a package whose bundled files are those of another folder.

    Unlike the real warm-up it loads no kernels and no readers: small meshes do without.
    """
    from pns_common.model import file

    file.BUNDLED = Path(folder)
    hold_model(model)


def stay_away(seconds: float, model: object) -> None:
    """A warm-up that does not come to its end."""
    time.sleep(seconds)


def obey(work: Work) -> Done:
    """`sleep 2`, `die`, `hold`, … as the body says; anything else is echoed."""
    body = Path(work.body).read_bytes()
    word, _, argument = body[:300].decode(errors="replace").partition(" ")
    match word:
        case "sleep":
            time.sleep(float(argument))
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hold":
            # One long match in C: the interpreter lock is not released, and no signal handler runs.
            re.match(r"(a+)+$", "a" * 40 + "b")
        case "fault":
            raise ZeroDivisionError("secret detail")
        case "unpicklable":
            raise UnpicklableError(lambda: None)
        case "unreadable":
            raise UnreadableError("not a GLB")
        case "broken":
            raise GltfError("accessor 3 is too short", pointer="/accessors/3/count")
        case "faces":
            raise LimitError("too many faces", limit="faces", allowed=5, found=20)
        case "large":
            fill(work, bytes(int(argument)))
            return Done({}, None)
        case "full":
            # What a full disk is to a process: a write that the kernel refuses.
            with files_of_at_most(int(argument) // 2):
                fill(work, bytes(int(argument)))
        case "memory":
            with job_memory(Limits(max_memory_bytes=int(argument))):
                bytearray(int(argument) + 2**31)
        case "steps":
            take_steps(Path(argument.strip()))
        case "log":
            logging.getLogger("pns.service").warning("a job says\nsomething")
        case "pid":
            body = str(os.getpid()).encode()
    fill(work, body)
    return Done({"read": 0.001, "refine": 0.002}, None, faces=4)


def fill(work: Work, data: bytes) -> None:
    """Write the same to whatever is wanted."""
    for file in (work.answer, work.report):
        if file is not None:
            memory_file.write(file, data)


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """Let this process write no file beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def take_steps(folder: Path) -> None:
    """Three quarters of a job; after each it waits until it may go on, or is stopped."""
    progress = PROGRESS.get()
    progress.begin("refine")
    for number in (1, 2, 3):
        progress.reach(number / 4)
        tell(folder / f"took-{number}")
        while not (folder / f"go-{number}").exists():
            time.sleep(0.002)
            progress.reach(number / 4)


def digest(work: Work) -> Done:
    """The body's SHA-256; it dawdles `before` and `after` it writes, as the content type says."""
    told = dict(part.split("=") for part in work.content_type.split("; ")[1:])
    body = Path(work.body).read_bytes()
    time.sleep(float(told["before"]))
    fill(work, hashlib.sha256(body).hexdigest().encode())
    time.sleep(float(told["after"]))
    return Done({}, None)


def digest_step_by_step(work: Work) -> Done:
    """The body's SHA-256; files of a folder tell what was done, and what may be done.

    It lives on for a while when it is told to end.
    """
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    told = Path(work.content_type.partition("folder=")[2])
    body = Path(work.body).read_bytes()
    tell(told / "read")
    wait_for(told / "may-write")
    fill(work, hashlib.sha256(body).hexdigest().encode())
    (told / "wrote").touch()
    wait_for(told / "may-return")
    return Done({}, None)


def tell(path: Path) -> None:
    """Leave a file with the process's number: whole or not at all, whoever else leaves the same."""
    whole = path.with_suffix(f".{os.getpid()}")
    whole.write_text(str(os.getpid()))
    whole.replace(path)


def wait_for(path: Path) -> None:
    while not path.exists():
        time.sleep(0.002)


class UnpicklableError(Exception):
    pass


def sleep(seconds: float) -> str:
    time.sleep(seconds)
    return "slept"


def pid() -> int:
    return os.getpid()


def leave_freed() -> int:
    """The pages that the process has once it has freed 36 MiB, and kept most of them."""
    from pns_common.memory import keep_freed_memory

    keep_freed_memory()
    tables = [bytearray(3 * 2**20) for _ in range(12)]
    del tables
    return pages(os.getpid())


_KEPT: list[object] = []


def leave_small_ones() -> int:
    """Free most of many small objects, and keep some among them; return this process's pages."""
    made = [{} for _ in range(500_000)]
    _KEPT.extend(made[::1000])
    held = pages(os.getpid())
    del made
    return held


def pages(process: int) -> int:
    return int(Path(f"/proc/{process}/statm").read_text().split()[1])


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def hold() -> None:
    re.match(r"(a+)+$", "a" * 40 + "b")


def begin_to_hold(begun: Path) -> None:
    tell(begun)
    hold()


def wait_between(folder: Path) -> int:
    """The process's number, once it may be told."""
    tell(folder / "begun")
    wait_for(folder / "go")
    return os.getpid()


def nothing() -> None:
    pass


def needs(path: str) -> None:
    if not Path(path).exists():
        raise NoModelError(f"no {path}")
