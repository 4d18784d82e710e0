"""The shapes to train and to validate on: a manifest, and their prepared arrays in a folder.

`shapes.csv` names each shape's public repository, its path there, the SHA-256 of that file, its
licence, how it was prepared, and the SHA-256 of the prepared arrays: vertices as float32 and faces
as int32, little-endian, one after the other.
"""

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

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


def take_shapes(mirror: Path, folder: Path) -> tuple[int, list[str]]:
    """Copy prepared shapes from anywhere below a folder, checked against the manifest.

    They come into `training` and `validation`, the second with its table `dense.csv`.

    Args:
        mirror: folder in which files are named as in the manifest.
        folder: where to put them; what is there with the right sum stays.

    Returns:
        How many shapes are there now, and what is missing or has another sum.
    """
    found = {path.stem: path for path in sorted(mirror.rglob("*.npz"))}
    count, wrong = 0, list[str]()
    rows = [("file", "kind")]
    for shape in listed_shapes():
        path = folder / shape.set / f"{shape.name}.npz"
        source = path if path.is_file() else found.get(shape.name)
        if source is None:
            wrong.append(f"{shape.name}: not in {mirror}")
            continue
        arrays = read_arrays(source)
        if sum_of(arrays) != shape.arrays:
            wrong.append(f"{shape.name}: {source} has another sum than the manifest's")
            continue
        if source != path:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
        if shape.set == VALIDATION:
            rows.append((path.name, shape.kind))
        count += 1
    if len(rows) > 1:
        with (folder / VALIDATION / "dense.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)
    return count, wrong


def shapes_command(
    folder: Annotated[Path, typer.Argument(help="Where to put the shapes.")],
    mirror: Annotated[Path, typer.Option("--from", help="Folder of prepared shapes.", exists=True)],
) -> None:
    """Fill a folder with the shapes to train and validate on; exit 1 if one is missing."""
    console = Console()
    count, wrong = take_shapes(mirror, folder)
    for line in wrong:
        console.print(escape(line), style="red", soft_wrap=True)
    console.print(f"{count} shapes of {len(listed_shapes())} in {escape(str(folder))}")
    if wrong:
        raise typer.Exit(1)
