"""Integers with a fraction: some exporters write `5126.0`, since their JSON has numbers alone."""

from __future__ import annotations

from typing import Any

from ...errors import GltfError
from ...report import Change
from .schema import Document, view

# Beyond it doubles no longer tell integers apart.
_LARGEST = 2**53


def lenient_view(tree: dict[str, Any]) -> tuple[Document, list[Change]]:
    """Return the typed view of a tree, in which integers may have a fraction of 0.

    Where one has, all whole numbers of the tree become integers, but those of applications
    (`extras`): to JSON they are the same.

    Raises:
        GltfError: a property is missing, of another type or outside its range.
    """
    try:
        return view(tree), []
    except GltfError as error:
        first = error
    if not _made_whole(tree):
        raise first
    what = "found, and read as integers: integers that are written with a fraction, as 3.0"
    return view(tree), [Change(first.pointer or "", what, 1)]


def _made_whole(tree: dict[str, Any]) -> bool:
    """Make whole floats integers, in place; whether there were any."""
    found = False
    pending: list[Any] = [tree]
    while pending:
        part = pending.pop()
        for key, value in list(part.items() if isinstance(part, dict) else enumerate(part)):
            if isinstance(value, dict | list):
                if key != "extras":
                    pending.append(value)
            elif isinstance(value, float) and value.is_integer() and abs(value) <= _LARGEST:
                part[key] = int(value)
                found = True
    return found
