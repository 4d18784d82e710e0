"""End a worker whose parent is gone, since its work is needed no more."""

from __future__ import annotations

import multiprocessing
import os
import threading


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
