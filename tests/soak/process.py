"""The service under test: started here, or running elsewhere on this machine."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.support.proxy import proxied

ROOT = Path(__file__).resolve().parents[2]
PROPORTIONAL = re.compile(r"^Pss_(?:Anon|Shmem): +(\d+) kB$", re.MULTILINE)
# Results are not kept for a quarter of an hour: they would still be there at the end.
SETTINGS = {"PNS_WORKERS": "2", "PNS_RESULT_SECONDS": "5", "PNS_PROXIES": "127.0.0.1"}
# The honest clients have one address together.
HONEST_RATE = 200
RUNNING = re.compile(r"running on http://([\d.]+):(\d+)")


@dataclass(frozen=True)
class Held:
    """Memory and descriptors of the service's processes."""

    mebibytes: float
    descriptors: int
    processes: int


@contextmanager
def started(log: Path) -> Iterator[tuple[tuple[str, int], int]]:
    """A server behind the proxy of deploy/, or alone where there is no nginx.

    Yields the address that clients ask, and the server's process id; its lines go to `log`.
    """
    command = [sys.executable, "-c", "from service.cli import main; main()", "serve", "--port", "0"]
    with log.open("w") as lines:
        process = subprocess.Popen(command, cwd=ROOT, stderr=lines, env=os.environ | SETTINGS)
    try:
        pause = threading.Event()
        while not (told := RUNNING.search(log.read_text())):
            if process.poll() is not None:
                raise RuntimeError(log.read_text()[-2000:])
            pause.wait(0.1)
        address = told[1], int(told[2])
        if shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin"):
            with (
                tempfile.TemporaryDirectory() as folder,
                proxied(address, Path(folder), seconds=10, rate=HONEST_RATE) as front,
            ):
                yield front, process.pid
        else:
            yield address, process.pid
    finally:
        process.terminate()
        process.wait(90)


def held_by(pid: int) -> Held:
    """Memory and descriptors of a process and those that it started."""
    family = [pid, *_children(pid)]
    return Held(
        mebibytes=sum(map(_proportional, family)) / 1024,
        descriptors=len(list(Path(f"/proc/{pid}/fd").iterdir())),
        processes=len(family),
    )


def least_held_by(pid: int, seconds: float) -> Held:
    """The least that is held meanwhile: what a job or a request takes, it gives back."""
    pause, seen = threading.Event(), [held_by(pid)]
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        pause.wait(0.5)
        seen.append(held_by(pid))
    return Held(
        min(held.mebibytes for held in seen),
        min(held.descriptors for held in seen),
        max(held.processes for held in seen),
    )


def lines_of(log: Path) -> list[dict[str, object]]:
    """The service's log; every line must be JSON."""
    return [json.loads(line) for line in log.read_text().splitlines()]


def _children(pid: int) -> Iterator[int]:
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, path.read_text().split()):
            yield child
            yield from _children(child)


def _proportional(pid: int) -> int:
    """KiB of memory, shared pages by parts. A part of a library's file grows as others end."""
    try:
        return sum(map(int, PROPORTIONAL.findall(Path(f"/proc/{pid}/smaps_rollup").read_text())))
    except OSError:
        # It has ended meanwhile.
        return 0
