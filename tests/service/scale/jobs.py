"""Stand-ins for the job of a batch, by the name of the file: what real files seldom do."""

import os
import signal
import time
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Numbered:
    """A task that leaves a line for each time that it is done."""

    number: int
    folder: Path
    attempt: int = 1

    @property
    def processes(self) -> list[int]:
        """The processes that began it."""
        file = self.folder / str(self.number)
        return [int(line) for line in file.read_text().split()] if file.exists() else []


def process_of(task: Numbered) -> int:
    """Return the process that does a task."""
    with (task.folder / str(task.number)).open("a") as lines:
        lines.write(f"{os.getpid()}\n")
    return os.getpid()


def third_dies(task: Numbered) -> tuple[int, int]:
    """No process survives task 3."""
    process_of(task)
    if task.number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return task.number, task.attempt


def hears_interrupts(task: Numbered) -> bool:
    """Return whether Ctrl-C reaches a process, asked of the one that comes in place of a first."""
    if task.attempt == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def divides_by_zero(task: Numbered) -> float:
    """A fault of ours."""
    return 1 / (task.attempt - task.attempt)


def ends_at_once() -> None:
    """A worker that cannot begin."""
    os._exit(1)
