"""Stand-ins for a part's job: workers that die."""

import os
import signal

from service.scale.large.part import PartDone, PartTask, run_part


def dies_at_first(task: PartTask) -> PartDone:
    """Every part's first worker dies when the part is done, but for its last line."""
    if task.attempt == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return run_part(task)


def dies_often(task: PartTask) -> PartDone:
    """No worker survives part 1."""
    if task.part == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return run_part(task)
