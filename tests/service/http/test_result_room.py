"""Results are as many as their disk has room for."""

import os
import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from service.http import room
from service.http.clients import Client
from service.http.routes import limits_of
from service.settings import Settings, StartError

Usage = namedtuple("Usage", "total used free")


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
