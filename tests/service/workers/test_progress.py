"""The page of a job: what its worker tells, and the word to stop."""

from __future__ import annotations

import mmap
import os
from pathlib import Path

import pytest

from service.errors import NoStorageError
from service.workers.progress import JobStopped, ProgressPage, Reporter


def test_the_server_reads_what_the_worker_tells() -> None:
    with ProgressPage() as page:
        assert (page.stage, page.share) == (None, 0)
        reporter = Reporter(page.file.name)
        reporter.stage("refine")
        reporter.reach(0.25)
        assert (page.stage, page.share) == ("refine", 0.25)


def test_a_job_that_is_stopped_ends_where_it_next_tells() -> None:
    with ProgressPage() as page:
        reporter = Reporter(page.file.name)
        page.stop()
        for tell in (
            lambda: reporter.stage("read"),
            lambda: reporter.reach(0.5),
        ):
            with pytest.raises(JobStopped):
                tell()


def test_a_page_that_cannot_be_mapped_is_a_named_refusal_and_leaves_no_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(*_: object) -> None:
        raise OSError(24, os.strerror(24))

    monkeypatch.setattr(mmap, "mmap", none)
    before = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(NoStorageError, match="Too many open files") as refused:
        ProgressPage()
    # The traceback still holds the page.
    assert refused.tb is not None
    assert len(list(Path("/proc/self/fd").iterdir())) == before
