"""A document's siblings on disk: files in its own folder, and in folders inside that."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from .sibling_files import File, SiblingFiles


def folder_of(document: Path) -> SiblingFiles:
    """Return what lies beside a file; links that lead out of its folder are not followed."""
    return SiblingFiles(partial(_find, document.parent.resolve()))


def _find(folder: Path, name: str) -> File | None:
    try:
        path = (folder / name).resolve()
        if not path.is_relative_to(folder) or not path.is_file():
            return None
    except OSError:
        # A name that no file can have, such as a very long one.
        return None
    return File(name, path.read_bytes())
