"""Memory files: what is proved of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from service.errors import NoStorageError
from service.workers import memory_file
from service.workers.memory_file import FileName, ForeignFileError, MemoryFile
from tests.support.stand_in_jobs import files_of_at_most


def test_another_process_reads_and_fills_a_file_by_its_name() -> None:
    with MemoryFile() as file:
        file.append(b"a body")
        assert memory_file.read(file.name) == b"a body"
        memory_file.write(file.name, b"short")
        assert b"".join(file.pieces()) == b"short"
        assert file.size == 5


def test_a_name_that_has_come_to_mean_another_file_is_refused() -> None:
    with MemoryFile() as old:
        name = old.name
    with MemoryFile() as new:
        new.append(b"somebody else's")
        # The lowest free number is the one that the first file had.
        assert new.name.path == name.path
        with pytest.raises(ForeignFileError):
            memory_file.read(name)
        with pytest.raises(ForeignFileError):
            memory_file.write(name, b"wrong")
        assert b"".join(new.pieces()) == b"somebody else's"


def test_what_does_not_fit_is_refused_and_nothing_of_it_stays() -> None:
    with MemoryFile() as file:
        memory_file.write(file.name, b"before")
        with files_of_at_most(5000), pytest.raises(NoStorageError, match="10000 bytes"):
            memory_file.write(file.name, bytes(10_000))
        assert file.size == 0
        with files_of_at_most(5000), pytest.raises(NoStorageError):
            file.append(bytes(10_000))


def test_a_name_that_has_come_to_mean_a_pipe_does_not_wait_for_it(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(ForeignFileError):
        memory_file.read(FileName(str(pipe), 0, 0))
