"""Stand-ins for the job of a batch, by the name of the file: what real files seldom do."""

import os
import signal
import time
from pathlib import Path

from service.scale.job import DONE, Row, Task


def misbehave(task: Task) -> Row:
    """Die, hang or fault as the file is called; all others are done at once."""
    name = Path(task.url).stem
    if name == "dies" or (name == "dies-once" and task.attempt == 1):
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "hangs":
        time.sleep(3600)
    return Row(task.url, task.output, DONE, attempts=task.attempt)


def process_of(_: Task) -> int:
    """Which process does a task."""
    return os.getpid()


def ends_at_once() -> None:
    """A worker that cannot begin."""
    os._exit(1)


def begins_at_once() -> None:
    """A worker that has nothing to prepare."""
