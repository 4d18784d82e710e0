"""Where readers put what they read: two files of rows, whatever the size."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from .arrays import append

POSITIONS, FACES = "raw-positions", "raw-faces"


class Sink:
    """Rows of positions (float64) and faces (int64), appended to files in a folder.

    `passed_over` counts, by name, what the file holds beside them.
    """

    def __init__(self, folder: Path) -> None:
        self.vertices, self.faces = 0, 0
        self.passed_over = Counter[str]()
        self._folder = folder
        # Of a run that was stopped.
        self.remove()

    def add_vertices(self, points: np.ndarray) -> None:
        """Append (N, 3) positions."""
        append(self._folder / POSITIONS, points.astype("<f8", copy=False))
        self.vertices += len(points)

    def add_faces(self, faces: np.ndarray) -> None:
        """Append (N, 3) rows of positions, which may come later."""
        append(self._folder / FACES, faces.astype("<i8", copy=False))
        self.faces += len(faces)

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all positions and faces, by memory map."""
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
