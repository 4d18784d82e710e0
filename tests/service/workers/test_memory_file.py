"""Memory files: what is proved of them."""

from pathlib import Path

import pytest

from service.errors import NoStorageError
from service.workers import memory_file
from service.workers.memory_file import MemoryFile
from tests.support.stand_in_jobs import files_of_at_most


def test_another_process_reads_and_fills_a_file_by_its_name():
    with MemoryFile() as file:
        file.append(b"a body")
        assert Path(file.name).read_bytes() == b"a body"
        memory_file.write(file.name, b"short")
        assert b"".join(file.pieces()) == b"short"
        assert file.size == 5


def test_what_does_not_fit_is_refused_and_nothing_of_it_stays():
    with MemoryFile() as file:
        memory_file.write(file.name, b"before")
        with files_of_at_most(5000), pytest.raises(NoStorageError, match="10000 bytes"):
            memory_file.write(file.name, bytes(10_000))
        assert file.size == 0
        with files_of_at_most(5000), pytest.raises(NoStorageError):
            file.append(bytes(10_000))
