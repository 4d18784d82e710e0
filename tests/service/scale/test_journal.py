"""What is known of a library's files outlives a run, and several runs at once."""

import fcntl
import json
import sqlite3

from service.scale.job import Row
from service.scale.journal import Journal


def test_a_journal_knows_only_what_was_done_by_the_same_work(tmp_path):
    journal = Journal(tmp_path / "r.jsonl", "one")
    journal.put([Row("a", "x", "done", input_sha256="1")])
    journal.put([Row("b", "y", "failed", input_sha256="2")])
    assert (journal.known("a"), journal.known("b")) == ("1", None)
    journal.close()
    other = Journal(tmp_path / "r.jsonl", "two")
    assert other.known("a") is None
    other.close()


def locked(folder):
    """Whether some run keeps others from the journals of a folder."""
    with (folder / "r.jsonl.journal-lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def test_a_journal_is_opened_and_closed_by_one_run_at_a_time(tmp_path, monkeypatch):
    """SQLite answers "locked" at once, whatever its timeout, where a log is begun or tidied up."""
    seen = []

    class Watched(sqlite3.Connection):
        def close(self):
            seen.append(("close", locked(tmp_path), (tmp_path / "r.jsonl").exists()))
            super().close()

    def connect(path, **settings):
        seen.append(("open", locked(tmp_path)))
        return Watched(path, **settings)

    monkeypatch.setattr("service.scale.journal.sqlite3.connect", connect)
    journal = Journal(tmp_path / "r.jsonl", "work")
    assert not locked(tmp_path)
    journal.close()
    # The report is written under the lock too: the last of several runs has the rows of all.
    assert seen == [("open", True), ("close", True, True)]
    assert not locked(tmp_path)


def test_the_last_of_two_runs_reports_the_rows_of_both(tmp_path):
    first, second = (Journal(tmp_path / "r.jsonl", "work") for _ in range(2))
    first.put([Row("a", "x", "done")])
    first.close()
    second.put([Row("b", "y", "done")])
    second.close()
    lines = (tmp_path / "r.jsonl").read_text().splitlines()
    assert [json.loads(line)["path"] for line in lines] == ["a", "b"]
