"""Coarse meshes for validation: dense shapes of seven kinds, by six simplifiers, to two sizes."""

import csv
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from pns_common import Mesh, MeshError, clean
from train.data.dense_meshes import read_mesh
from train.data.pairs.polygons import REMESHERS
from train.data.sharp_labels import Segments, sharp_edges
from train.data.simplifiers import SIMPLIFIERS

# Faces of the coarse meshes, and how many meshes each shape gives.
SIZES, EACH = (700, 2500), 3

# The dense mesh has at least so many times the coarse one's faces.
LEAST_REDUCTION = 2

# Kinds whose dense meshes have exact sharp edges, and what these turn by at least, radians.
SHARP_KINDS, SHARP = ("part", "building"), np.radians(30)


@dataclass(frozen=True, eq=False, slots=True)
class Shape:
    """A dense mesh, taken as the truth.

    Attributes:
        kind: scan, sculpt, medical, part, building, game or terrain.
        sharp: its true sharp edges; None where they are not known.
    """

    name: str
    kind: str
    mesh: Mesh
    sharp: Segments | None


@dataclass(frozen=True, slots=True)
class Drawn:
    """A coarse mesh to make: of which file, by which simplifier, of how many faces."""

    path: Path
    kind: str
    simplifier: str
    faces: int


def validation_meshes(
    folder: Path, most: int | None = None, makers: Collection[str] = SIMPLIFIERS.keys()
) -> list[Drawn]:
    """Return what to simplify, kind by kind in turn; `dense.csv` of the folder says the kinds.

    Files that it names and that are not there are left out. Simplifiers and sizes go round from
    shape to shape, so that each meets every kind.
    """
    with (folder / "dense.csv").open(newline="", encoding="utf-8") as file:
        listed = [(folder / row["file"], row["kind"]) for row in csv.DictReader(file)]
    kinds: dict[str, list[tuple[int, Path]]] = defaultdict(list)
    for number, (path, kind) in enumerate(listed):
        if path.is_file():
            kinds[kind].append((number, path))
    names = list(makers)
    drawn = [
        Drawn(
            found[1], kind, names[(found[0] + 2 * turn) % len(names)], SIZES[(found[0] + turn) % 2]
        )
        for turn in range(EACH)
        for row in zip_longest(*kinds.values())
        for kind, found in zip(kinds, row, strict=True)
        if found is not None
    ]
    return drawn[:most]


def read_shape(path: Path, kind: str) -> Shape:
    """Return a dense mesh with its sharp edges: the file's own, or those that turn enough."""
    sharp, mesh = None, read_mesh(path)
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            sharp = arrays["vertices"][arrays["sharp_edges"]] if "sharp_edges" in arrays else None
    if sharp is None and kind in SHARP_KINDS:
        sharp = sharp_edges(mesh, SHARP)
    return Shape(path.stem, kind, mesh, None if sharp is None else sharp.astype(np.float64))


def coarse_mesh(shape: Shape, drawn: Drawn) -> Mesh | None:
    """Return a coarse mesh of a shape; None where that is too small, or nothing is left."""
    faces = min(drawn.faces, len(shape.mesh.faces) // LEAST_REDUCTION)
    try:
        if drawn.simplifier in REMESHERS:
            return REMESHERS[drawn.simplifier](shape.mesh, faces)
        return clean(SIMPLIFIERS[drawn.simplifier](shape.mesh, faces)).mesh
    except MeshError:
        return None
