"""Sources of a batch: a folder, a glob, or a file, one item at a time."""

from __future__ import annotations

import posixpath
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ..bodies.media import is_apple_double
from ..errors import InvalidParameter
from .places import Place, place_of


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
    # Before folders: over HTTP, whatever holds links may be taken for one.
    if place.path.lower().endswith(endings) and place.is_file():
        return lambda: iter([Item(place.url, posixpath.basename(place.path))])
    if place.is_folder():
        inside = None if results is None else place.path_to(results)
        if inside == ".":
            raise InvalidParameter(
                "DEST", f"{source} is SOURCE too: results need a folder of their own"
            )
        return lambda: _in_folder(place, endings, inside)
    if place.is_file():
        text = f"{source}: a file's name ends in one of {', '.join(endings)}"
        raise InvalidParameter("SOURCE", text)
    raise InvalidParameter("SOURCE", f"{source}: there is no such folder, glob or file")


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
