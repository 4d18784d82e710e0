"""Materials and textures of an OBJ or a PLY: which files these are, and copies beside results."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..bodies.sibling_files import File, Opened
from ..changes import Change, counted
from ..errors import UnreadableError
from .mtl import files_of_obj, found
from .ply import ply_header


def companions(data: bytes, kind: str, opened: Opened) -> list[File]:
    """Return the files that a mesh file leads to, of those that came along, by where they lie."""
    if kind == "obj":
        return files_of_obj(data, opened)
    if kind != "ply" or b"TextureFile" not in data[: 2**20]:
        return []
    try:
        names = ply_header(data).textures
    except UnreadableError:
        return []
    files = [found(name, ("",), opened) for name in names]
    return list({file.name: file for file in files if file is not None}.values())


def copied(
    files: Iterable[File],
    read: Callable[[str], bytes | None],
    write: Callable[[str, bytes], None],
    *,
    force: bool,
) -> list[Change]:
    """Write files beside a result, as they lie beside its source; return what was done.

    `read` returns what is there under a relative name, or None. A file with other bytes stays,
    unless `force` is set.
    """
    made, left = list[str](), list[str]()
    for file in files:
        content, there = bytes(file.content), read(file.name)
        if there is None or (force and there != content):
            write(file.name, content)
            made.append(file.name)
        elif there != content:
            left.append(file.name)
    told = ("copied-beside", made), ("not-copied", left)
    return counted({(code, ", ".join(names)): len(names) for code, names in told})
