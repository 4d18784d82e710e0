"""Results are as many as their disk has room for."""

import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from service.http import result_room
from service.http.limits import limits_of
from service.settings import Settings

Usage = namedtuple("Usage", "total used free")


def on_a_disk(monkeypatch: pytest.MonkeyPatch, free: int) -> list[Path]:
    """A disk with so many free bytes; the list tells of which folders that was asked."""
    asked: list[Path] = []
    monkeypatch.setattr(
        shutil, "disk_usage", lambda folder: (asked.append(folder), Usage(2 * free, free, free))[1]
    )
    return asked


def test_results_take_no_more_than_leaves_room_for_those_that_are_made(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    asked = on_a_disk(monkeypatch, 1000)
    settings = result_room.fitting(Settings(result_bytes=900, result_folder=tmp_path))
    assert asked == [tmp_path]
    assert limits_of(settings).result_bytes == 750
    assert "750, in place of the 900 of PNS_RESULT_BYTES" in caplog.text


def test_where_there_is_room_or_no_word_of_it_nothing_changes(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    on_a_disk(monkeypatch, 1000)
    settings = Settings(result_bytes=750)
    assert result_room.fitting(settings) is settings
    monkeypatch.undo()
    missing = Settings(result_folder=tmp_path / "missing")
    assert result_room.fitting(missing) is missing
    assert caplog.messages == []
