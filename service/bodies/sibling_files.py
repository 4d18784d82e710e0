"""The files beside a glTF: found by a relative name among what came with it, never fetched."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from unicodedata import normalize
from urllib.parse import unquote

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
# The path of a file has 4,096 bytes at most, each as three characters. What is longer, without end
# perhaps, would take eighty times its size to decode and to split.
_LONGEST_URI = 2**14


@dataclass(frozen=True)
class File:
    """A file that came with the document: what its sender calls it, and its bytes."""

    name: str
    content: bytes | memoryview


@dataclass(frozen=True)
class SiblingFiles:
    """Files beside a document.

    Attributes:
        find: the file of a safe relative name, None where there is none.
        names: all files that came, where they are known.
        folder: the document's own among what came; "" where that is all there is.
    """

    find: Callable[[str], File | None]
    names: frozenset[str] = frozenset()
    folder: str = ""


# A document that came without any other file.
ALONE = SiblingFiles(lambda name: None)


@dataclass
class Opened:
    """The siblings that a document names, each opened once.

    `size` is their bytes, as often as they were asked for: so often they may be written.
    """

    siblings: SiblingFiles
    files: dict[str, File | None] = field(default_factory=dict)
    size: int = 0

    def open(self, uri: str) -> File | None:
        """Open the file behind a URI; None where it did not come, or the URI leads elsewhere."""
        name = self.name_of(uri)
        if name is None:
            return None
        if name not in self.files:
            # With its accents as they are, composed, and apart, as macOS packs archives.
            spellings = dict.fromkeys((name, normalize("NFC", name), normalize("NFD", name)))
            found = (self.siblings.find(spelling) for spelling in spellings)
            self.files[name] = next((file for file in found if file is not None), None)
        file = self.files[name]
        self.size += 0 if file is None else len(file.content)
        return file

    def name_of(self, uri: str) -> str | None:
        """Return the name among what came that a URI leads to; None where it leads elsewhere."""
        return safe_name(uri, self.siblings.folder)

    @property
    def unused(self) -> list[str]:
        """Files that came and that the document does not name."""
        used = {file.name for file in self.files.values() if file is not None}
        return sorted(self.siblings.names - used)


def has_scheme(uri: str) -> bool:
    """Return whether a URI names a place of its own (https:…), wherever the document lies."""
    return _SCHEME.match(uri) is not None


def safe_name(uri: str, folder: str = "") -> str | None:
    """Return the name of a file that may have come with a document; None for any other URI.

    ``folder`` is the document's own among what came: so far up a URI may lead. One that is longer
    than a path may be leads nowhere.
    """
    if len(uri) > _LONGEST_URI or has_scheme(uri):
        return None
    # Exporters on Windows write its separators, and browsers take them for slashes too.
    path, steps = unquote(uri).replace("\\", "/"), folder.split("/") if folder else []
    if path.startswith("/"):
        return None
    for step in path.split("/"):
        if step not in ("", ".", ".."):
            steps.append(step)
        elif step == "..":
            if not steps:
                return None
            steps.pop()
    return relative_name("/".join(steps))


def relative_name(path: str) -> str | None:
    """Return a relative path's shortest form; None if it could lead out of its folder."""
    if path.startswith("/") or "\\" in path or any(ord(letter) < 32 for letter in path):
        return None
    steps = [step for step in path.split("/") if step not in ("", ".")]
    if not steps or ".." in steps or ":" in steps[0]:
        return None
    return "/".join(steps)


def folder_of(document: Path) -> SiblingFiles:
    """Return what lies beside a file; links that lead out of its folder are not followed."""
    folder = document.parent.resolve()

    def find(name: str) -> File | None:
        try:
            path = (folder / name).resolve()
            if not path.is_relative_to(folder) or not path.is_file():
                return None
        except OSError:
            # A name that no file can have, such as a very long one.
            return None
        return File(name, path.read_bytes())

    return SiblingFiles(find)
