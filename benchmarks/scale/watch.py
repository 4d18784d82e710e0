"""What a run takes while it goes on: memory of this process and of its workers, and disk."""

from __future__ import annotations

import shutil
import threading
from dataclasses import dataclass, field
from pathlib import Path

SECONDS = 0.5
# Resident: with mapped files. Proportional: shared pages divided. Anonymous: without files.
KINDS = {"Rss": "resident", "Pss": "proportional", "Anonymous": "anonymous"}


@dataclass
class Watch:
    """The largest values seen, in bytes; sampled twice a second from Linux's /proc."""

    folder: Path
    driver: dict[str, int] = field(default_factory=dict)
    worker: dict[str, int] = field(default_factory=dict)
    disk: int = 0

    def __enter__(self) -> Watch:
        self._used = shutil.disk_usage(self.folder).used
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look_on, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _look_on(self) -> None:
        while not self._over.wait(SECONDS):
            _keep_largest(self.driver, _memory_of("self"))
            for listed in Path("/proc/self/task").glob("*/children"):
                try:
                    children = listed.read_text().split()
                except OSError:
                    continue
                for child in children:
                    _keep_largest(self.worker, _memory_of(child))
            self.disk = max(self.disk, shutil.disk_usage(self.folder).used - self._used)

    def as_dict(self) -> dict[str, int]:
        """Return all values, by process and kind."""
        named = {f"driver_{kind}_bytes": value for kind, value in self.driver.items()}
        named |= {f"worker_{kind}_bytes": value for kind, value in self.worker.items()}
        return named | {"disk_bytes": self.disk}


def _memory_of(process: str) -> dict[str, int]:
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()[1:]
    except OSError:  # it has ended
        return {}
    values = dict(line.split(":", 1) for line in lines)
    return {KINDS[name]: int(values[name].split()[0]) * 1024 for name in KINDS}


def _keep_largest(known: dict[str, int], seen: dict[str, int]) -> None:
    for kind, value in seen.items():
        known[kind] = max(known.get(kind, 0), value)
