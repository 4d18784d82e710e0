"""Journal of a batch: a run that is killed continues from here.

SQLite, so that two runs at once do no harm and memory does not grow with the number of files. The
report is written from it at the end, in whole.
"""

from __future__ import annotations

import errno
import fcntl
import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pns_common.files import replacing

from ..errors import InvalidParameter
from .job import PLANNED, SKIPPED, UNREADABLE_FOLDER, Known, Row
from .places import place_of

SCHEMA = """
CREATE TABLE IF NOT EXISTS rows (
  path TEXT, work TEXT, status TEXT, code TEXT, input TEXT, row TEXT, PRIMARY KEY (path, work)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS outputs (output TEXT PRIMARY KEY, path TEXT) WITHOUT ROWID;
"""
BUSY_SECONDS = 60.0
ENDING = ".jsonl"
JOURNAL = ".pns-batch.journal"


class Journal:
    """The rows of a report, by file and by work: options, model and formats as one hash."""

    def __init__(self, report: Path, work: str) -> None:
        self.report = report
        self._work = work
        self._file = journal_of(report)
        with _alone_with(self._file):
            self._database = sqlite3.connect(self._file, timeout=BUSY_SECONDS, isolation_level=None)
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.execute("PRAGMA synchronous=NORMAL")
            self._database.executescript(SCHEMA)

    def known(self, path: str) -> Known | None:
        """Return what this same work has made of a file; None without."""
        row = self._database.execute(
            "SELECT input, json_extract(row, '$.output_sha256') FROM rows "
            "WHERE path = ? AND work = ? AND status = 'done'",
            (path, self._work),
        ).fetchone()
        return None if row is None else Known(*row)

    def claim(self, output: str, path: str) -> bool:
        """Return whether a result may be written at `output`: no other file holds that place."""
        self._database.execute("INSERT OR IGNORE INTO outputs VALUES (?, ?)", (output, path))
        query = "SELECT path FROM outputs WHERE output = ?"
        holder = str(self._database.execute(query, (output,)).fetchone()[0])
        if holder != path and not place_of(holder).is_gone():
            return False
        # Rows of another file's or of another work's result there, which is about to be replaced.
        self._database.execute(
            "DELETE FROM rows WHERE path = ? AND NOT (path = ? AND work = ?) "
            "AND json_extract(row, '$.output') = ?",
            (holder, path, self._work, output),
        )
        self._database.execute("UPDATE outputs SET path = ? WHERE output = ?", (path, output))
        return True

    def put(self, rows: list[Row]) -> None:
        """Keep rows of files; those skipped, or only planned, leave what is known as it is."""
        kept = [
            row
            for row in rows
            if row.status not in (SKIPPED, PLANNED) and row.code != UNREADABLE_FOLDER
        ]
        if not kept:
            return
        with self.together():
            self._database.executemany(
                "INSERT OR REPLACE INTO rows VALUES (?, ?, ?, ?, ?, ?)",
                (
                    (
                        row.path,
                        self._work,
                        row.status,
                        row.code,
                        row.input_sha256,
                        json.dumps(row.as_dict()),
                    )
                    for row in kept
                ),
            )

    @contextmanager
    def together(self) -> Iterator[None]:
        """Write all changes inside at once, or none of them; other runs wait meanwhile."""
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            # SQLite has rolled back already where the disk is full.
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise
        self._database.execute("COMMIT")

    def close(self) -> None:
        """Write the report of this work, whole, and let go of the file."""
        # The last of several runs to come here writes the rows of all of them.
        with _alone_with(self._file):
            try:
                self._write_report()
            finally:
                self._database.close()

    def _write_report(self) -> None:
        query = "SELECT row FROM rows WHERE work = ? ORDER BY path"
        with replacing(self.report) as temporary, temporary.open("w") as lines:
            for (row,) in self._database.execute(query, (self._work,)):
                lines.write(f"{row}\n")


@contextmanager
def open_journal(report: Path, work: str) -> Iterator[Journal]:
    """Open a journal whose report is written at the end, also after an interruption.

    Raises:
        OSError: the journal or the report cannot be read or written; it names which.
    """
    try:
        journal = Journal(report, work)
        try:
            yield journal
        finally:
            journal.close()
    except sqlite3.Error as error:
        file = journal_of(report)
        raise OSError(errno.EIO, f"it cannot be used as a journal: {error}", str(file)) from error


def journal_of(report: Path) -> Path:
    """Return the file beside a report from which a run resumes, whatever the report is called."""
    return report.with_name(JOURNAL)


def check_report(report: Path) -> None:
    """Raise InvalidParameter where a report cannot be written under this name."""
    if report.suffix != ENDING:
        raise InvalidParameter("report", f"{report}: it must end in {ENDING}")
    if not report.parent.is_dir():
        raise InvalidParameter("report", f"{report.parent}: there is no such folder")
    if report.is_dir():
        raise InvalidParameter("report", f"{report}: it is a folder")


@contextmanager
def _alone_with(journal: Path) -> Iterator[None]:
    """Keep other runs from opening or closing a journal meanwhile.

    SQLite answers "locked" at once, whatever its timeout, while another connection starts its log
    or tidies it up. The lock is a file of its own: closing SQLite's own would let go of its locks.
    """
    with journal.with_name(journal.name + "-lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
