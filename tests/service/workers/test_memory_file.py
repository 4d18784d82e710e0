"""Memory files: who holds them, and what is proved of them."""

from __future__ import annotations

import os
import subprocess
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


def test_a_file_stays_until_everybody_has_let_go() -> None:
    with MemoryFile() as file:
        file.hold()
    assert not file.closed
    assert memory_file.read(file.name) == b""
    file.release()
    assert file.closed
    with pytest.raises(ValueError, match="closed"):
        file.hold()


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


@pytest.mark.parametrize("on_disk", [False, True])
def test_what_does_not_fit_is_refused_and_nothing_of_it_stays(
    on_disk: bool, tmp_path: Path
) -> None:
    with MemoryFile(tmp_path if on_disk else None) as file:
        memory_file.write(file.name, b"before")
        with files_of_at_most(5000), pytest.raises(NoStorageError, match="10000 bytes"):
            memory_file.write(file.name, bytes(10_000))
        assert file.size == 0
        with files_of_at_most(5000), pytest.raises(NoStorageError):
            file.append(bytes(10_000))


@pytest.mark.skipif(os.geteuid() != 0, reason="needs to mount a small file system")
def test_a_full_disk_is_one_of_these(tmp_path: Path) -> None:
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(tmp_path)], check=False
    )
    if mounted.returncode != 0:
        pytest.skip("nothing can be mounted here")
    try:
        with MemoryFile(tmp_path) as file:
            with pytest.raises(NoStorageError, match="No space"):
                memory_file.write(file.name, bytes(10**6))
            memory_file.write(file.name, bytes(60_000))
    finally:
        subprocess.run(["umount", "--lazy", str(tmp_path)], check=True)


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NoStorageError):
        MemoryFile(tmp_path / "missing")


def test_a_name_that_has_come_to_mean_a_pipe_does_not_wait_for_it(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(ForeignFileError):
        memory_file.read(FileName(str(pipe), 0, 0))
