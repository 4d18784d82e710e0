"""Processes that are to be killed while a worker of theirs is inside a job."""

import asyncio
import time
from dataclasses import dataclass
from pathlib import Path

from service.scale.engines import local
from service.scale.engines.work import Work
from service.workers.pool import Workers
from tests.support import stand_in_jobs


def hold_open(pipe: Path) -> None:
    """A job that is told by a pipe which it opens, and which only its process's end closes."""
    with pipe.open("wb") as held:
        held.write(b"begun")
        held.flush()
        time.sleep(3600)


@dataclass(frozen=True)
class Task:
    """The same for a batch."""

    pipe: Path
    attempt: int = 1


def hold_open_for(task: Task) -> None:
    hold_open(task.pipe)


def serve(pipe: Path) -> None:
    """Have a worker of the service do it."""

    async def scenario() -> None:
        workers = Workers(1, 3600, stand_in_jobs.nothing, print)
        workers.start()
        await workers.run(workers.join("a"), hold_open, pipe)

    asyncio.run(scenario())


def refine_a_library(pipe: Path) -> None:
    """Have a worker of a batch do it."""
    work = Work(hold_open_for, lambda task, error: None, None)
    list(local.local(work, 1)(iter([Task(pipe)])))
