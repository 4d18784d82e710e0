"""Settings fit this machine: connections its open files, results their disk."""

import os
import re
import resource
import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from service.http import room
from service.http.clients import Client
from service.http.room import connections_that_fit
from service.http.routes import limits_of
from service.settings import Settings, StartError

Usage = namedtuple("Usage", "total used free")
SETTINGS = Settings(workers=1, queue=2, connections=100)


def allow(monkeypatch: pytest.MonkeyPatch, soft: int, hard: int) -> list[tuple[int, int]]:
    """A system with these limits; the list tells what was asked of it."""
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (soft, hard))
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: asked.append(limits))
    return asked


def test_the_limit_is_raised_as_far_as_is_needed_and_allowed(monkeypatch):
    asked = allow(monkeypatch, 64, 10**6)
    assert connections_that_fit(SETTINGS) == 100
    ((needed, hard),) = asked
    assert (needed > 100, hard) == (True, 10**6)
    # With what was asked for, and without a limit, nothing is asked again.
    for enough in (needed, resource.RLIM_INFINITY):
        asked = allow(monkeypatch, enough, enough)
        assert connections_that_fit(SETTINGS) == 100
        assert asked == []
    allow(monkeypatch, 64, needed - 60)
    assert connections_that_fit(SETTINGS) == 90


def test_every_connection_may_hold_a_request_that_waits_to_be_measured(monkeypatch):
    """Its own descriptor and five files; uploads are connections too, and count no further."""
    wanted = []
    for connections, uploads in ((100, 1), (101, 1), (101, 500)):
        asked = allow(monkeypatch, 64, 10**6)
        settings = Settings(workers=1, queue=2, connections=connections, uploads=uploads)
        assert connections_that_fit(settings) == connections
        ((needed, _),) = asked
        wanted.append(needed)
    assert wanted == [wanted[0], wanted[0] + 6, wanted[0] + 6]


def test_where_not_one_connection_fits_the_service_says_what_it_needs(monkeypatch):
    allow(monkeypatch, 64, 64)
    with pytest.raises(StartError, match="64 open files are allowed") as refusal:
        connections_that_fit(SETTINGS)
    (needed,) = map(int, re.findall(r"(\d+) needed", str(refusal.value)))
    allow(monkeypatch, needed, needed)
    assert connections_that_fit(SETTINGS) == 1


def on_a_disk(monkeypatch: pytest.MonkeyPatch, free: int) -> list[Path]:
    """A disk with so many free bytes; the list tells of which folders that was asked."""
    asked: list[Path] = []
    monkeypatch.setattr(
        shutil, "disk_usage", lambda folder: (asked.append(folder), Usage(2 * free, free, free))[1]
    )
    return asked


def none(*_: object) -> None:
    raise OSError(2, "there is none")


def test_results_take_no_more_than_leaves_room_for_those_that_are_made(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    asked = on_a_disk(monkeypatch, 1000)
    settings = room.with_results_that_fit(Settings(result_bytes=900, result_folder=tmp_path))
    assert asked == [tmp_path]
    assert limits_of(settings, Client("", None)).result_bytes == 750
    assert "750, in place of the 900 of PNS_RESULT_BYTES" in caplog.text


def test_where_there_is_room_or_no_word_of_it_nothing_changes(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    on_a_disk(monkeypatch, 1000)
    settings = Settings(result_bytes=750)
    assert room.with_results_that_fit(settings) is settings
    monkeypatch.setattr(shutil, "disk_usage", none)
    assert room.with_results_that_fit(settings) is settings
    assert caplog.messages == []


def test_a_folder_that_cannot_be_written_is_refused_at_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    file.touch()
    closed = tmp_path / "closed"
    closed.mkdir()
    # Whoever runs this may be somebody whom no mode of a folder keeps out.
    monkeypatch.setattr(os, "access", lambda path, _: path != closed)
    for folder in (tmp_path / "missing", file, closed):
        with pytest.raises(StartError, match=str(folder)):
            room.with_results_that_fit(Settings(result_folder=folder))
    monkeypatch.setattr(room, "gettempdir", none)
    with pytest.raises(StartError, match="nowhere: there is none"):
        room.with_results_that_fit(Settings())
