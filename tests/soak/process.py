"""The service under test: started here, or running elsewhere on this machine."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.support.proxy import proxied

ROOT = Path(__file__).resolve().parents[2]
PROPORTIONAL = re.compile(r"^Pss_(?:Anon|Shmem): +(\d+) kB$", re.MULTILINE)
# The honest clients have one address together.
SETTINGS = {"PNS_WORKERS": "2", "PNS_CLIENT_REQUESTS": "8", "PNS_PROXIES": "127.0.0.1"}
HONEST_RATE = 200
RUNNING = re.compile(r"running on http://([\d.]+):(\d+)")


@dataclass(frozen=True)
class Held:
    """Memory and descriptors of the service's processes."""

    mebibytes: float
    descriptors: int
    processes: int


@contextmanager
def started(log):
    """Two replicas behind the proxy of deploy/, or one alone where there is no nginx.

    Yields the address that clients ask, and the first replica's process id; lines of both go to
    `log`, the proxy's to access.log beside it.
    """
    with ExitStack() as stack:
        first, pid = stack.enter_context(_replica(log))
        if shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin"):
            second, _ = stack.enter_context(_replica(log))
            options = {"seconds": 10, "rate": HONEST_RATE}
            front = stack.enter_context(proxied(first, log.parent, second, **options))
            yield front, pid
        else:
            yield first, pid


@contextmanager
def _replica(log):
    command = [sys.executable, "-c", "from service.cli import main; main()", "serve", "--port", "0"]
    with log.open("a") as lines:
        before = log.stat().st_size
        process = subprocess.Popen(command, cwd=ROOT, stderr=lines, env=os.environ | SETTINGS)
    try:
        pause = threading.Event()
        while not (told := RUNNING.search(log.read_text()[before:])):
            if process.poll() is not None:
                raise RuntimeError(log.read_text()[-2000:])
            pause.wait(0.1)
        yield (told[1], int(told[2])), process.pid
    finally:
        process.terminate()
        process.wait(90)


def least_held_by(pid, seconds):
    """The least that each process of a family holds meanwhile: what a job takes, it gives back.

    Of each, whenever that is: with clients all the time they seldom rest at the same moment. One
    that came meanwhile holds what it holds at the end.
    """
    pause, until = threading.Event(), time.monotonic() + seconds
    first = least = _sizes(pid)
    descriptors, processes = _descriptors(pid), len(first)
    while time.monotonic() < until:
        pause.wait(0.5)
        sizes = _sizes(pid)
        for one in first.keys() & least.keys() & sizes.keys():
            sizes[one] = min(sizes[one], least[one])
        least = sizes
        descriptors, processes = min(descriptors, _descriptors(pid)), max(processes, len(sizes))
    return Held(sum(least.values()) / 1024, descriptors, processes)


def lines_of(log):
    """The service's log; every line must be JSON."""
    return [json.loads(line) for line in log.read_text().splitlines()]


def faults_in(log):
    """Lines of the proxy and the service about requests that failed for no fault of their own."""
    access = log.parent / "access.log"
    proxy = lines_of(access) if access.exists() else []
    service = lines_of(log)
    faults = {
        line.get("request_id")
        for line in (*proxy, *service)
        if line.get("status") in (500, 502, 504)
    }
    return [line for line in (*proxy, *service) if line.get("request_id") in faults]


def _children(pid):
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, path.read_text().split()):
            yield child
            yield from _children(child)


def _sizes(pid):
    """KiB by process: shared pages by parts. A part of a library's file grows as others end."""
    sizes = {}
    for one in (pid, *_children(pid)):
        # It may end meanwhile.
        with suppress(OSError):
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
            sizes[one] = sum(map(int, PROPORTIONAL.findall(text)))
    return sizes


def _descriptors(pid):
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))
