"""Sources of a batch: a folder, a glob, or a manifest, one item at a time.

Nothing is collected: a manifest of a million rows takes the memory of one.
"""

from __future__ import annotations

import csv
import json
import posixpath
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from typing import Any

from ..bodies.media import is_apple_double
from ..errors import InvalidParameter
from .places import Place, place_of

MANIFESTS = (".txt", ".csv", ".jsonl", ".ndjson", ".parquet")
COLUMN = "path"
ROWS = 4096


@dataclass(frozen=True)
class Item:
    """A file to refine: its URL, and where its result lies below the destination.

    Or a folder that cannot be listed, with what is wrong: the files in it are not refined.
    """

    url: str
    relative: str
    fault: str = ""


def items_of(
    source: str, kinds: tuple[str, ...], results: Place | None = None
) -> Callable[[], Iterator[Item]]:
    """Return a function that lists a source anew; folders and globs give files of `kinds` alone.

    What lies at `results`, where these go, is theirs, and not listed by a folder around it.

    Raises:
        InvalidParameter: there is nothing at `source`, or its results would take its place.
    """
    endings = tuple(f".{kind}" for kind in kinds)
    place = place_of(source)
    # What is there is meant by its name: `parts [v2]` is a folder.
    if any(letter in source for letter in "*?[") and not (place.is_file() or place.is_folder()):
        return lambda: _globbed(place, endings, results)
    name = place.path.lower()
    # Before folders: over HTTP, whatever holds links may be taken for one.
    if name.endswith((*endings, *MANIFESTS)) and place.is_file():
        if name.endswith(endings):
            return lambda: iter([Item(place.url, posixpath.basename(place.path))])
        return lambda: (_listed(path, place) for path in _paths(place))
    if place.is_folder():
        inside = None if results is None else place.path_to(results)
        if inside == ".":
            raise InvalidParameter(
                "DEST", f"{source} is SOURCE too: results need a folder of their own"
            )
        return lambda: _in_folder(place, endings, inside)
    if place.is_file():
        raise InvalidParameter(
            "SOURCE", f"{source}: a manifest's name ends in one of {', '.join(MANIFESTS)}"
        )
    raise InvalidParameter("SOURCE", f"{source}: there is no such folder, glob or manifest")


def _in_folder(place: Place, endings: tuple[str, ...], results: str | None) -> Iterator[Item]:
    faults: list[OSError] = []
    for file in place.files(faults.append):
        if _is_mesh(file, endings) and not _is_result(file, results):
            yield Item(place.below(file).url, file)
    for error in faults:
        # One that has gone meanwhile is not there to be refined.
        if not isinstance(error, FileNotFoundError):
            yield Item(str(error.filename or place.url), "", error.strerror or str(error))


def _is_mesh(path: str, endings: tuple[str, ...]) -> bool:
    return path.lower().endswith(endings) and not is_apple_double(path)


def _is_result(file: str, results: str | None) -> bool:
    """Return whether a file lies in the folder of results; both below one folder."""
    return results is not None and file.startswith(f"{results}/")


def _globbed(place: Place, endings: tuple[str, ...], results: Place | None) -> Iterator[Item]:
    # The part before the first wildcard is the root that relative paths are taken from.
    fixed = place.path
    for letter in "*?[":
        fixed = fixed.partition(letter)[0]
    root = Place(place.system, posixpath.dirname(fixed))
    inside = None if results is None else root.path_to(results)
    for path in place.matches():
        file = posixpath.relpath(path, root.path)
        if _is_mesh(path, endings) and not _is_result(file, inside):
            yield Item(Place(place.system, path).url, file)


def _listed(path: str, manifest: Place) -> Item:
    """Return a manifest's row; relative paths start at its folder, unless it says otherwise."""
    if "://" in path or posixpath.isabs(path):
        return Item(path, path.partition("://")[2].lstrip("/") or path.lstrip("/"))
    folder = Place(manifest.system, posixpath.dirname(manifest.path))
    clean = posixpath.normpath(path)
    relative = "/".join(step for step in clean.split("/") if step != "..")
    return Item(folder.below(clean).url, relative)


def _paths(manifest: Place) -> Iterator[str]:
    try:
        yield from _rows(manifest)
    except (ValueError, csv.Error) as error:  # JSON's, Parquet's and those of text too
        text = f"{manifest.url}: this is not a readable manifest: {error}"
        raise InvalidParameter("SOURCE", text) from error


def _rows(manifest: Place) -> Iterator[str]:
    ending = posixpath.splitext(manifest.path)[1].lower()
    if ending == ".parquet":
        yield from _of_parquet(manifest)
        return
    with manifest.system.open(manifest.path, "rb") as raw:
        text = TextIOWrapper(raw, encoding="utf-8-sig", newline="")
        if ending == ".csv":
            yield from _of_rows(csv.DictReader(text), manifest)
        elif ending == ".txt":
            for line in text:
                path = line.strip()
                if path and not path.startswith("#"):
                    yield path
        else:
            yield from _of_rows((json.loads(line) for line in text if line.strip()), manifest)


def _of_rows(rows: Iterator[Any] | csv.DictReader[str], manifest: Place) -> Iterator[str]:
    for number, row in enumerate(rows, start=1):
        path = row.get(COLUMN) if isinstance(row, dict) else None
        if not isinstance(path, str) or not path:
            raise InvalidParameter("SOURCE", f"{manifest.url}: row {number} has no '{COLUMN}'")
        yield path


def _of_parquet(manifest: Place) -> Iterator[str]:
    try:
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise InvalidParameter(
            "SOURCE", f"{manifest.url}: Parquet needs the extra: pip install 'pns-subdivision[ray]'"
        ) from error
    with manifest.system.open(manifest.path, "rb") as raw:
        table = parquet.ParquetFile(raw)
        if COLUMN not in table.schema_arrow.names:
            raise InvalidParameter("SOURCE", f"{manifest.url}: there is no column '{COLUMN}'")
        batches = table.iter_batches(batch_size=ROWS, columns=[COLUMN])
        yield from _of_rows((row for batch in batches for row in batch.to_pylist()), manifest)
