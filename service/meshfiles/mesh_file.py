"""A mesh as a file lists it: polygons, and what their corners and faces carry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from pns_common.schemes.matrix import SubdivisionMatrix

from ..changes import Change, counted
from .tags import Tags

# Layers are called as glTF calls attributes; other properties begin with an underscore.
UV, NORMAL, COLOUR = "TEXCOORD_0", "NORMAL", "COLOR_0"
MATERIAL, GROUP, OBJECT, SMOOTHING = "material", "group", "object", "smoothing group"
# The label or the row of what has none.
NONE = -1


@dataclass(frozen=True, eq=False)
class Layer:
    """Values at corners.

    Attributes:
        values: (N, K) in the type that the file stores; integers of a colour are fractions.
        rows: (C,) the row of each corner; NONE where it has no value.
    """

    values: Shaped[np.ndarray, "N K"]
    rows: Int[np.ndarray, " C"]


@dataclass(frozen=True, eq=False)
class Labels:
    """Names of faces: of materials, groups or objects. `of_face` numbers `names`, or is NONE."""

    names: tuple[str, ...]
    of_face: Int[np.ndarray, " F"]

    def named(self, name: str, *, words: bool = False) -> Bool[np.ndarray, " F"]:
        """Return which faces have a name; with `words`, or one of several between blanks."""
        own = [name == each or (words and name in each.split()) for each in self.names]
        return np.array([*own, False])[self.of_face]


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Polygons as a file has them.

    Attributes:
        vertices: (V, 3) positions.
        offsets: (F + 1,) where the corners of each polygon begin; the last is their number.
        corners: (C,) the vertex of each corner.
        layers: values at corners by name; texture coordinates count v upwards.
        face_values: (F, K) values of faces, by name.
        labels: names of faces, by what they name.
        libraries: files that define the materials, as the file spells them.
        textures: images that a PLY names, likewise.
        encoding: of the names above, and of those in labels.
        double: whether a format that has both is to store positions as doubles.
        changes: what the reader dropped or mended.
        tags: creases that the file states; None: it states none.
        parents: of a refined mesh, the vertices of the file that each vertex is made of.
        unit: of its lengths, as a 3MF names it; "": it does not say.
    """

    vertices: Float[np.ndarray, "V 3"]
    offsets: Int[np.ndarray, " F1"]
    corners: Int[np.ndarray, " C"]
    layers: dict[str, Layer] = field(default_factory=dict)
    face_values: dict[str, Shaped[np.ndarray, "F K"]] = field(default_factory=dict)
    labels: dict[str, Labels] = field(default_factory=dict)
    libraries: tuple[str, ...] = ()
    textures: tuple[str, ...] = ()
    encoding: str = "utf-8"
    double: bool = False
    changes: tuple[Change, ...] = ()
    tags: Tags | None = None
    parents: SubdivisionMatrix | None = None
    unit: str = ""

    @cached_property
    def sizes(self) -> Int[np.ndarray, " F"]:
        """Number of corners of each polygon."""
        return np.diff(self.offsets)

    @property
    def faces(self) -> Int[np.ndarray, "F 3"]:
        """The vertices of triangles; raises ValueError where a face is none."""
        return self.corners.reshape(len(self.offsets) - 1, 3)

    def with_changes(self, changes: Iterable[Change]) -> MeshFile:
        """Return a copy of which more was dropped or mended."""
        return replace(self, changes=(*self.changes, *changes))

    def of_faces(self, keep: Bool[np.ndarray, " F"]) -> MeshFile:
        """Return a copy of some of its faces."""
        return self.taken(offsets_of(self.sizes[keep]), np.repeat(keep, self.sizes), keep)

    def cut(self, places: Int[np.ndarray, "T 3"], face: Int[np.ndarray, " T"]) -> MeshFile:
        """Return the triangles of its faces, by the places of their corners and by their face."""
        return self.taken(np.arange(0, places.size + 1, 3), places.reshape(-1), face)

    def taken(
        self, offsets: Int[np.ndarray, " G1"], corner: np.ndarray, face: np.ndarray
    ) -> MeshFile:
        """Return some corners as faces that begin at `offsets` and are parts of some faces."""
        return replace(
            self,
            offsets=offsets,
            corners=self.corners[corner],
            layers={name: Layer(own.values, own.rows[corner]) for name, own in self.layers.items()},
            face_values={name: values[face] for name, values in self.face_values.items()},
            labels={k: Labels(own.names, own.of_face[face]) for k, own in self.labels.items()},
        )


def of_triangles(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    uv: Float[np.ndarray, "V 2"] | None = None,
    normals: Float[np.ndarray, "V 3"] | None = None,
) -> MeshFile:
    """Make a mesh of triangles; `uv` and `normals` are those of the vertices."""
    corners = faces.reshape(-1).astype(np.int64, copy=False)
    given = {NORMAL: normals, UV: uv}
    layers = {name: Layer(values, corners) for name, values in given.items() if values is not None}
    return MeshFile(vertices, np.arange(0, len(corners) + 1, 3), corners, layers)


def shown(layer: str) -> str:
    """Return what users call a layer."""
    known = {UV: "texture coordinates", NORMAL: "vertex normals", COLOUR: "vertex colours"}
    return known.get(layer, f"attribute {layer}")


def as_fractions(values: np.ndarray) -> np.ndarray:
    """Return colours as fractions of 1, whatever type stores them."""
    return values / np.iinfo(values.dtype).max if values.dtype.kind in "ui" else values


def colours_of(values: np.ndarray) -> np.ndarray:
    """Return colours as fractions, bytes or words: other whole numbers count to 255."""
    if values.dtype.str[1:] in ("u1", "u2"):
        return values
    whole = values.dtype.kind in "ui" or ((values > 1).any() and (values == np.rint(values)).all())
    return np.clip(values, 0, 255).astype(np.uint8) if whole else values


def joined_layer(
    parts: Sequence[tuple[Shaped[np.ndarray, "N K"] | None, Int[np.ndarray, " C"]]],
) -> Layer:
    """Join values of one name, some of which a part has, and the rows of all corners.

    Colours of different types become fractions with opacity.
    """
    if len(parts) == 1 and parts[0][0] is not None:
        return Layer(parts[0][0], parts[0][1])
    given = [values for values, _ in parts if values is not None]
    rows: list[Int[np.ndarray, " C"]] = []
    total = 0
    for values, own in parts:
        rows.append(np.where((own < 0) | (values is None), NONE, own + total))
        total += 0 if values is None else len(values)
    if len({(values.dtype, values.shape[1]) for values in given}) > 1:
        width = max(values.shape[1] for values in given)
        wide = [((0, 0), (0, width - values.shape[1])) for values in given]
        given = [
            np.pad(as_fractions(values).astype(np.float64), pad, constant_values=1.0)
            for values, pad in zip(given, wide, strict=True)
        ]
    return Layer(np.concatenate(given), np.concatenate(rows))


def offsets_of(sizes: Int[np.ndarray, " F"]) -> Int[np.ndarray, " F1"]:
    """Return where polygons of these sizes begin, and where the last ends."""
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])


def dropped(names: dict[str, int]) -> tuple[Change, ...]:
    """Return a change for each kind of thing of which a reader dropped some."""
    return tuple(counted({("dropped", name): count for name, count in names.items()}))
