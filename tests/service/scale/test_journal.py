"""Knowledge of a library's files outlives a run, and several runs at once."""

import json
from contextlib import contextmanager
from pathlib import Path

import pytest

from pns_common.files import replacing
from service.scale.job import Known, Row
from service.scale.journal import Journal, open_journal


def test_a_journal_knows_only_what_was_done_by_the_same_work(tmp_path):
    journal = Journal(tmp_path / "r.jsonl", "one")
    journal.put([Row("a", "x", "done", input_sha256="1", output_sha256="2")])
    journal.put([Row("b", "y", "failed", input_sha256="2")])
    assert (journal.known("a"), journal.known("b")) == (Known("1", "2"), None)
    journal.close()
    other = Journal(tmp_path / "r.jsonl", "two")
    assert other.known("a") is None
    other.close()


def test_a_file_that_is_no_journal_is_told_by_name(tmp_path):
    (tmp_path / ".pns-batch.journal").write_bytes(b"years of work" * 100)
    with pytest.raises(OSError, match="not a database") as refusal:
        open_journal(tmp_path / "r.jsonl", "work").__enter__()
    assert refusal.value.filename == f"{tmp_path}/.pns-batch.journal"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_report_that_a_full_disk_cannot_take_is_named(tmp_path, monkeypatch):
    @contextmanager
    def full(report):
        with replacing(report):
            yield Path("/dev/full")

    monkeypatch.setattr("service.scale.journal.replacing", full)
    with (
        pytest.raises(OSError, match="No space left") as refusal,
        open_journal(tmp_path / "r.jsonl", "work") as journal,
    ):
        journal.put([Row("a", "x", "done")])
    assert refusal.value.filename == f"{tmp_path}/r.jsonl"


def test_a_journal_that_is_full_says_so_and_keeps_what_it_has(tmp_path):
    def too_many(journal):
        journal.put([Row("a", "x", "done")])
        journal._database.execute("PRAGMA max_page_count = 1")
        journal.put([Row(f"b{number}", "y" * 4000, "done") for number in range(100)])

    with (
        pytest.raises(OSError, match="is full"),
        open_journal(tmp_path / "r.jsonl", "work") as journal,
    ):
        too_many(journal)
    assert len((tmp_path / "r.jsonl").read_text().splitlines()) == 1


def test_the_last_of_two_runs_reports_the_rows_of_both(tmp_path):
    first, second = (Journal(tmp_path / "r.jsonl", "work") for _ in range(2))
    first.put([Row("a", "x", "done")])
    first.close()
    second.put([Row("b", "y", "done")])
    second.close()
    lines = (tmp_path / "r.jsonl").read_text().splitlines()
    assert [json.loads(line)["path"] for line in lines] == ["a", "b"]
