"""The shapes to train and to validate on: a manifest, and their prepared arrays in a folder.

`shapes.csv` names each shape's public repository, its path there, the SHA-256 of that file, its
licence, how it was prepared, and the SHA-256 of the prepared arrays: vertices as float32 and faces
as int32, little-endian, one after the other.
"""

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MANIFEST = Path(__file__).with_name("shapes.csv")
TRAINING, VALIDATION = "training", "validation"
# Names of the arrays in files of the folder, and in some mirrors.
ARRAYS = ("vertices", "faces"), ("V", "F")
SHARP = "sharp_edges"


@dataclass(frozen=True, slots=True)
class ListedShape:
    """A row of the manifest; `sha256` is empty where the original is not one public file."""

    name: str
    set: str
    kind: str
    repository: str
    path: str
    sha256: str
    licence: str
    preparation: str
    arrays: str


def listed_shapes(which: str | None = None) -> list[ListedShape]:
    """Return the shapes of a set, or of both, in the order of the manifest."""
    with MANIFEST.open(newline="", encoding="utf-8") as file:
        rows = [ListedShape(**row) for row in csv.DictReader(file)]
    return [row for row in rows if which in (None, row.set)]


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return vertices, faces, and sharp edges if there are any, of a prepared file."""
    with np.load(path) as held:
        vertices, faces = next(names for names in ARRAYS if names[0] in held)
        made = {"vertices": held[vertices].astype("<f4"), "faces": held[faces].astype("<i4")}
        return made | ({SHARP: held[SHARP]} if SHARP in held else {})


def sum_of(arrays: dict[str, np.ndarray]) -> str:
    """Return the SHA-256 of prepared arrays."""
    return hashlib.sha256(arrays["vertices"].tobytes() + arrays["faces"].tobytes()).hexdigest()
