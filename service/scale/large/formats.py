"""What a large mesh is read from and written to, by the endings of the names."""

from __future__ import annotations

import errno
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...errors import InvalidParameter
from ...report import Change
from .arrays import ABOUT, ArrayMesh, open_mesh
from .glb import read_glb
from .plan import keep, kept
from .readers import read_obj, read_ply, read_stl
from .sink import Sink
from .survey import Survey
from .target import Target, new_folder, new_ply
from .tiles import TILESET, Tiles, new_tiles, write_tileset
from .weld import weld_outside_memory

READERS: dict[str, Callable[[Path, Sink], None]] = {
    ".ply": read_ply,
    ".stl": read_stl,
    ".obj": read_obj,
    ".glb": read_glb,
}
PLY, TILES = ".ply", ".3dtiles"
ARRAY_FILES = re.compile(r"(positions|faces|creases)\.npy|mesh\.json")
TILE_FILES = re.compile(r"tileset\.json|part-\d+\.glb|\.part-\d+\.glb\.[0-9a-f]+\.tmp")


@dataclass(frozen=True)
class OutputKind:
    """A way to write: by its ending; what an output of it holds, where it is a folder."""

    ending: str
    holds: str | None

    @property
    def numbered(self) -> bool:
        """Whether vertices have the numbers that `refine` gives them."""
        return self.ending != TILES

    def new(self, work: Path, about: Survey, vertices: int, faces: int) -> Target | Tiles:
        """Create files of their final size, to be filled.

        Raises:
            LimitError: the disk has no room for them.
        """
        out = work / "out"
        if self.ending == PLY:
            return new_ply(out, vertices, faces)
        if self.ending == TILES:
            return new_tiles(out, about)
        out.mkdir(exist_ok=True)
        return new_folder(out, vertices, faces)

    def finish(
        self,
        target: Target | Tiles,
        work: Path,
        output: Path,
        report: dict[str, Any],
        boxes: list[Any],
    ) -> None:
        """Put what is full in its place.

        Raises:
            FileExistsError: what came there meanwhile is somebody's.
        """
        out = work / "out"
        if not out.exists():
            return  # a run before this one ended between the last renaming and its own tidying
        if isinstance(target, Tiles):
            write_tileset(target, boxes, report)
        elif self.holds is not None:
            keep(out / ABOUT, report)
        if self.holds is not None and output.exists():
            # No error of ours, with which the work would go.
            if words := _not_ours(output, self):
                raise FileExistsError(errno.EEXIST, words, str(output))
            output.rename(work / "replaced")
        out.rename(output)


def input_mesh(source: Path, work: Path) -> tuple[ArrayMesh, dict[str, Any]]:
    """Return the arrays of an input, and what is not in them: of a file they are made in ``work``.

    What is not in them is told as reports tell it, under `dropped` and `changes`.

    Raises:
        InvalidParameter: none of the formats that are read.
        UnreadableError: not what its ending says.
        UnrefinableError: an index out of range, or no face with three different vertices.
    """
    if source.is_dir():
        return open_mesh(source), {"dropped": {}, "changes": []}
    reader = READERS.get(source.suffix.lower())
    if reader is None:
        endings = ", ".join(READERS)
        raise InvalidParameter("IN", f"{source}: it must be a folder of arrays, or {endings}")
    folder = work / "input"
    folder.mkdir(exist_ok=True)
    missing = kept(folder / ABOUT)
    if missing is None:
        sink = Sink(folder)
        reader(source, sink)
        changes = [Change("", f"{what} dropped", n) for what, n in sink.passed_over.items()]
        missing = {
            "dropped": asdict(weld_outside_memory(*sink.rows(), folder)),
            "changes": [asdict(change) for change in changes],
        }
        sink.remove()
        keep(folder / ABOUT, missing)
    return open_mesh(folder), missing


def output_kind(output: Path) -> OutputKind:
    """Return how an output of this name is written.

    Raises:
        InvalidParameter: none of the formats that are written, or it would replace something else.
    """
    ending = output.suffix.lower()
    if ending == PLY:
        if output.is_dir():
            raise InvalidParameter("OUT", f"{output}: it is a folder")
        return OutputKind(PLY, None)
    if ending not in ("", TILES):
        raise InvalidParameter(
            "OUT", f"{output}: it must end in {PLY} or {TILES}, or in nothing: a folder of arrays"
        )
    kind = OutputKind(ending, TILESET if ending else ABOUT)
    if output.exists() and (words := _not_ours(output, kind)):
        raise InvalidParameter("OUT", f"{output}: {words}")
    return kind


def _not_ours(output: Path, kind: OutputKind) -> str:
    """Say why a folder is not to be replaced; nothing where it may be."""
    strangers = _strangers(output, kind)
    if not strangers and (output / str(kind.holds)).exists():
        return ""
    named = f": {strangers[0]}" if strangers else ""
    return f"it is there already, and holds something else{named}"


def _strangers(output: Path, kind: OutputKind) -> list[str]:
    """Return what is in a folder that no run wrote: it would be lost with what is replaced."""
    if not output.is_dir():
        return [output.name]
    ours = TILE_FILES if kind.ending == TILES else ARRAY_FILES
    return sorted(file.name for file in output.iterdir() if not ours.fullmatch(file.name))
