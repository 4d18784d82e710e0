"""What a large mesh's work is, and its folder beside the output: what a later run goes on from."""

from __future__ import annotations

import fcntl
import hashlib
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pns_common.base.whole_file import replace_file

from ...errors import InvalidParameter, ServiceError, UnreadableError, WorkerDied
from ...options import Options
from ..report_file import check_report_file
from .arrays import CREASES, FACES, POSITIONS

# Raised whenever parts come out otherwise than before: parts of two versions would not meet.
VERSION = 2
PLAN, ENTRIES, LOCK = "plan.json", "entries.json", "pns-large.lock"


@dataclass(frozen=True)
class Large:
    """What to make of one mesh.

    Attributes:
        source, output: files or folders; their endings say which.
        memory: bytes that a worker may take.
        parts: how many to cut it into; None: as many as the memory asks for.
        model: a bundled name or a file; None: the default one.
    """

    source: Path
    output: Path
    options: Options
    memory: int
    parts: int | None = None
    model: str | None = None

    @property
    def work(self) -> Path:
        """The folder of what is not finished."""
        return self.output.with_name(f"{self.output.name}.work")


def check_report(report: Path, large: Large) -> None:
    """Raise InvalidParameter where a report cannot be written, or would lie in a mesh's place."""
    check_report_file(report)
    meshes = large.source.resolve(), large.output.resolve()
    if any(report.resolve().is_relative_to(mesh) for mesh in meshes):
        raise InvalidParameter("report", f"{report}: it must lie outside of IN and OUT")


@contextmanager
def work_folder(large: Large, model_hash: str | None) -> Iterator[Path]:
    """Yield the folder of a work, with what an earlier run of the same left in it; no other run's.

    Each plan has a folder of its own in ``large.work``, so that a worker that outlived a killed run
    of another plan writes nothing into this one's files. All is removed once the work is done, or
    refused; it stays where a run was stopped, or its workers died.

    Raises:
        InvalidParameter: there is no such input or no folder for the output, another run has the
            folder, or it is somebody's.
    """
    entries = entries_of(large.source)
    if not large.output.parent.is_dir():
        raise InvalidParameter("OUT", f"{large.output.parent}: there is no such folder")
    contents = contents_of(large.source)
    work = large.work
    work.mkdir(exist_ok=True)
    if any(work.iterdir()) and not (work / LOCK).exists():
        raise InvalidParameter("OUT", f"{work}: it is needed, and holds something else")
    with (work / LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InvalidParameter("OUT", f"{work}: another run is at work there") from error
        plan = {
            "version": VERSION,
            "source": contents,
            "options": asdict(large.options),
            "model": model_hash,
            "parts": large.parts,
            "memory": large.memory,
            "output": large.output.name,
        }
        text = json.dumps(plan, sort_keys=True).encode()
        folder = work / hashlib.sha256(text).hexdigest()[:16]
        if not (folder / PLAN).exists():
            for left in work.iterdir():
                if left.name != LOCK:
                    shutil.rmtree(left) if left.is_dir() else left.unlink()
            folder.mkdir()
            replace_file(folder / PLAN, text)
        keep(folder / ENTRIES, entries)
        try:
            yield folder
        except WorkerDied:
            raise
        except ServiceError:
            # Refused: the same again would be refused again.
            _remove(work, folder)
            raise
        _remove(work, folder)


def check_unchanged(large: Large, folder: Path) -> None:
    """Raise UnreadableError where the input is not the one that a work began with."""
    began_with = kept(folder / PLAN)["source"]
    # Read again only where somebody has touched it.
    touched = entries_of(large.source) != kept(folder / ENTRIES)
    if touched and contents_of(large.source) != began_with:
        raise UnreadableError(f"{large.source}: it changed while it was refined; run it again")


def _remove(work: Path, folder: Path) -> None:
    # First of all: what is half removed is nothing to go on from.
    (folder / PLAN).unlink(missing_ok=True)
    shutil.rmtree(work)


def contents_of(source: Path) -> list[list[str]]:
    """Return what tells a file, or arrays of a folder, from others: the ending, and the bytes.

    However often they were copied, moved, or given other dates and rights since.
    """
    hashes: list[list[str]] = []
    for path in _files(source):
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        hashes.append([path.suffix if path == source else path.name, digest])
    return hashes


def entries_of(source: Path) -> list[list[int]]:
    """Return what stays while nobody touches an input: whose entries, sizes, times of change.

    Those of the entries: nobody can set them, as archives do with those of the contents.

    Raises:
        InvalidParameter: there is no such file.
    """
    known = [file.stat() for file in _files(source)]
    if not known:
        raise InvalidParameter("IN", f"{source}: there is no such file or folder of arrays")
    return [[entry.st_ino, entry.st_size, entry.st_ctime_ns] for entry in known]


def _files(source: Path) -> list[Path]:
    files = [source]
    if source.is_dir():
        files = [source / name for name in (POSITIONS, FACES, CREASES)]
    return [file for file in files if file.exists()]


def keep(file: Path, values: Any) -> None:
    """Write values as JSON, whole or not at all."""
    replace_file(file, json.dumps(values).encode())


def kept(file: Path) -> Any:
    """Return what ``keep`` wrote; None where it has not.

    Raises:
        UnreadableError: it is not whole.
    """
    if not file.exists():
        return None
    try:
        return json.loads(file.read_text())
    except ValueError as error:
        raise damaged(file) from error


def damaged(file: Path) -> UnreadableError:
    """Return the error of a file of a work that is not whole: with it goes the work."""
    return UnreadableError(f"{file}: it was not written whole; the same command begins anew")
