"""The room that a large mesh takes on the disk, looked for before the work rather than after it."""

from __future__ import annotations

import shutil
from pathlib import Path

from ...errors import LimitError
from .formats import OutputKind
from .survey import Survey

# What the passes leave beside the output: an order of the faces, and the faces at each vertex.
PASSES_BYTES_PER_FACE = 25


def bytes_needed(about: Survey, levels: int, kind: OutputKind) -> int:
    """Return about what a run writes; vertices are those of a mesh with two faces an edge."""
    vertices, faces = about.vertices, about.faces
    for _ in range(levels):
        vertices, faces = vertices + faces * 3 // 2, faces * 4
    point = 24 if kind.numbered else 12
    return PASSES_BYTES_PER_FACE * about.faces + point * vertices + 12 * faces


def check_room(folder: Path, about: Survey, levels: int, kind: OutputKind) -> None:
    """Raise LimitError where a disk has no room for what a run writes."""
    needed, free = bytes_needed(about, levels, kind), shutil.disk_usage(folder).free
    if needed > free:
        text = f"{folder}: about {needed / 1e9:.1f} GB are needed, {free / 1e9:.1f} GB are free"
        raise LimitError(text, limit="disk", allowed=free, found=needed)
