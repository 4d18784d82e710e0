"""Where readers put what they read: two files of rows, whatever the size."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np

POSITIONS, FACES = "raw-positions", "raw-faces"


class Sink:
    """Rows of positions (float64) and faces (int64), appended to files in a folder."""

    def __init__(self, folder: Path) -> None:
        self.vertices, self.faces = 0, 0
        self._folder = folder
        self._positions = (folder / POSITIONS).open("wb")
        self._faces = (folder / FACES).open("wb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._positions.close()
        self._faces.close()

    def add_vertices(self, points: np.ndarray) -> None:
        """Append (N, 3) positions."""
        np.ascontiguousarray(points, dtype="<f8").tofile(self._positions)
        self.vertices += len(points)

    def add_faces(self, faces: np.ndarray) -> None:
        """Append (N, 3) rows of positions, which may come later."""
        np.ascontiguousarray(faces, dtype="<i8").tofile(self._faces)
        self.faces += len(faces)

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all positions and faces, by memory map, once the files are closed."""
        return (
            _mapped(self._folder / POSITIONS, "<f8", self.vertices),
            _mapped(self._folder / FACES, "<i8", self.faces),
        )

    def remove(self) -> None:
        """Remove the files."""
        for name in (POSITIONS, FACES):
            (self._folder / name).unlink(missing_ok=True)


def _mapped(path: Path, kind: str, rows: int) -> np.ndarray:
    return np.memmap(path, kind, "r", 0, (rows, 3)) if rows else np.zeros((0, 3), kind)
