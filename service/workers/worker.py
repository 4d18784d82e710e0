"""Run jobs in a worker process: its preparation, and the one door for jobs."""

from __future__ import annotations

import ctypes
import gc
import logging
import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TypeVar

from .. import log_lines
from ..errors import ServiceError
from ..log_lines import REQUEST_ID
from .progress import PROGRESS, Progress

T = TypeVar("T")

# New objects between two searches for cycles. A scene of thousands of meshes is hundreds of
# thousands of objects, hardly one of them in a cycle: to search them as often as usual is a fifth
# of its time.
OBJECTS_A_SEARCH = 50_000
# What a terminal sends to the workers of a process too: Ctrl-C, and that it closes.
OF_TERMINAL = {getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)}


class JobFaultError(Exception):
    """A fault of ours inside a job; the text is the worker's traceback, for the log only."""


def prepare(progress: Progress) -> None:
    """Set up a fresh worker process."""
    PROGRESS.set(progress)
    # A Python handler would wait for the next bytecode, and one numpy call may take seconds.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    log_lines.configure()
    # It logs what an upload says, word for word.
    logging.getLogger("python_multipart").setLevel(logging.CRITICAL)
    # A signal to the server's process group (a terminal, a supervisor) must not end requests that
    # run.
    os.setsid()
    end_with_parent()


def call(function: Callable[..., T], *arguments: object) -> T:
    """Run a job; a foreseen error crosses to the server as it is, any other as JobFaultError.

    Not every exception survives pickling, and one that does not would take the pool with it. What
    is logged meanwhile has the request's id.
    """
    REQUEST_ID.set(next((getattr(value, "request_id", None) for value in arguments), None))
    try:
        with rare_searches():
            return function(*arguments)
    except ServiceError as error:
        _let_go(error)
        raise error.with_traceback(None) from None
    except Exception as error:
        text = "".join(traceback.format_exception(error))
        _let_go(error)
        raise JobFaultError(text) from None
    finally:
        give_back()


def _let_go(error: BaseException | None) -> None:
    """Clear the frames of an error and of its causes, which hold the job's files and arrays.

    The error is kept until it is sent, and in a cycle for longer.
    """
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        traceback.clear_frames(error.__traceback__)
        error.__traceback__ = None
        cause, context = error.__cause__, error.__context__
        error.__cause__ = error.__context__ = None
        error = cause or context


@contextmanager
def rare_searches() -> Iterator[None]:
    """Search for cycles rarely, and at the end: what lies in them may hold large arrays."""
    usual = gc.get_threshold()
    gc.set_threshold(OBJECTS_A_SEARCH)
    try:
        yield
    finally:
        gc.set_threshold(*usual)
        gc.collect(0)


def give_back() -> None:
    """Return freed memory, which glibc keeps for the next job, to the system."""
    # Only glibc has it.
    getattr(ctypes.CDLL(None), "malloc_trim", bool)(0)


@contextmanager
def no_interrupt() -> Iterator[None]:
    """Keep these from threads and processes that are started inside: to end them is for whoever
    starts them, and one that is still importing would say so at length."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, OF_TERMINAL)
    try:
        # Python's own, which counts locks and is started with the first, lets Ctrl-C through.
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, OF_TERMINAL)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """End this process once the one that started it has ended, in whatever way, also inside a job.

    One that is killed tells nobody; what it had begun would run on, beside the next one's.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:

        def end() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=end, daemon=True).start()
