"""Show a batch on a terminal: its progress, its failures, and a summary."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Task as RichTask
from rich.table import Table
from rich.text import Text

from ..errors import printable
from .job import DONE, FAILED, PLANNED, SKIPPED, Row
from .sources import Item


@dataclass(frozen=True)
class Summary:
    """Summary of a batch: files by outcome, faces of the results, failures by code; the report."""

    report: Path
    counts: dict[str, int]
    faces: dict[str, int]
    failures: list[tuple[str, int]]

    @property
    def failed(self) -> int:
        """Files that could not be refined."""
        return self.counts.get(FAILED, 0)


def print_summary(summary: Summary, console: Console) -> None:
    """Print what became of the files or would, in faces too, and the failures by code."""
    table = Table("files", "", "faces")
    for status in (DONE, SKIPPED, PLANNED, FAILED):
        if status in summary.counts:
            faces = summary.faces[status]
            table.add_row(f"{summary.counts[status]:,}", status, f"{faces:,}" if faces else "")
    console.print(table)
    if summary.failures:
        codes = Table("files", "code")
        for code, count in summary.failures:
            codes.add_row(f"{count:,}", code)
        console.print(codes)
    # What is only planned was said file by file, and is in no report.
    if PLANNED not in summary.counts:
        console.print(f"a row for each file: {summary.report}", markup=False)


class _Rate(ProgressColumn):
    """Files a second."""

    def render(self, task: RichTask) -> Text:
        """Return the rate, as far as it is known."""
        return Text("" if task.speed is None else f"{task.speed:.1f} a second")


def progress(console: Console) -> Progress:
    """Return the bar of a batch, where there is a terminal to draw it on."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(),
        TextColumn("{task.fields[failed]} failed"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def count_aside(listing: Callable[[], Iterator[Item]], bar: Progress, line: TaskID) -> None:
    """Count the files beside the work, so that the estimate knows how many there are."""
    if bar.disable:
        return

    def count() -> None:
        bar.update(line, total=sum(1 for _ in listing()))

    threading.Thread(target=count, daemon=True).start()


def line_of(row: Row) -> str:
    """Return what is said of a file at once: why it failed, or what is planned."""
    path = printable(row.path)
    if row.status == FAILED:
        # Of a fault of ours it is a traceback.
        detail = "\n".join(map(printable, row.detail.split("\n")))
        return f"{path}: {detail} [{row.code}]"
    if row.status == PLANNED:
        return f"{path} -> {printable(row.output)}: {row.faces_in:,} faces to {row.faces_out:,}"
    return ""
