"""Compress refined geometry: `compress=draco`, `compress=meshopt`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import DracoPy
import meshopt
import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.mesh.rows import extent

from ...changes import Change, counted
from ...stages import Stages
from ..constants import OUTLINE
from ..read.compressed import DRACO
from ..read.extensions import declare, drop
from ..read.schema import Accessor
from ..refine.attributes import RefinedPrimitive
from .writer import Writer, describe

# Of the two extensions for meshopt, the one that all readers support.
MESHOPT = "EXT_meshopt_compression"
# Peak bytes of encoding a refined face: at least 1.2 times what was measured (609, 58) on 200,000
# faces that share no vertex, with normals and UVs.
BYTES_PER_FACE = {"none": 0, "draco": 750, "meshopt": 80}

POSITION_BITS, NORMAL_BITS, TEXCOORD_BITS = 16, 10, 14
# From 0, fastest, to 10, smallest; Draco's tools use 7.
EFFORT = 7

# Draco may compare all pairs of faces around a vertex and cannot be interrupted. So many pairs take
# up to a second.
MOST_PAIRS = 10**9

# Draco's types of attributes.
_POSITION, _NORMAL, _TEXCOORD = 0, 1, 3
_NAMED = {_POSITION: "POSITION", _NORMAL: "NORMAL", _TEXCOORD: "TEXCOORD_0"}
# First id of other attributes.
_FIRST_GENERIC = 1
_TYPES = tuple(np.dtype(kind) for kind in ("f4", "u1", "u2", "u4"))

# Draco passes its grid on as text of six decimals. If cells are not much wider, the grid is made of
# such numbers: positions outside of it would turn predicted normals, or fail.
_TEXT_STEP = 1e-6
_WIDE_CELL = 2 * _TEXT_STEP
# Smaller meshes would be rounded too coarsely.
_LEAST_SIZE = 10 * _TEXT_STEP


@dataclass
class MeshoptWriter(Writer):
    """Compresses each view of refined geometry losslessly; `expanded` is its decoded size."""

    expanded: int = 0
    views: int = 0

    def stored(self, content: Shaped[np.ndarray, "N B"]) -> dict[str, Any]:
        """Append compressed elements; return a view of them in a placeholder buffer."""
        attributes = content.dtype == np.uint8
        mode = "INDICES" if self.in_order else "TRIANGLES"
        mode = "ATTRIBUTES" if attributes else mode
        rows = content if attributes else content.reshape(-1)
        data = meshopt.encode_gltf_buffer(np.ascontiguousarray(rows), mode)
        view = {
            "buffer": 1,
            "byteOffset": self.expanded,
            "byteLength": content.nbytes,
            "extensions": {
                MESHOPT: {
                    "buffer": 0,
                    "byteOffset": self.append(memoryview(data)),
                    "byteLength": len(data),
                    "byteStride": content.shape[1] * content.itemsize,
                    "count": len(content),
                    "mode": mode,
                }
            },
        }
        # Whole words: rows of attributes are, and the number of faces is a multiple of four.
        self.expanded += content.nbytes
        self.views += 1
        return view

    def bytes_of(self, view: dict[str, Any]) -> dict[str, Any]:
        """Return the object with the byteOffset and byteLength of a view's bytes in BIN."""
        return view.get("extensions", {}).get(MESHOPT, view)

    def finish(self) -> list[bytes | memoryview]:
        """Write the lengths of the buffers into the tree; return the pieces of BIN."""
        pieces = super().finish()
        if self.views:
            placeholder = {"byteLength": self.expanded, "extensions": {MESHOPT: {"fallback": True}}}
            self.tree["buffers"].append(placeholder)
            declare(self.tree, MESHOPT)
        return pieces

    def changes(self) -> list[Change]:
        """Return the number of compressed views."""
        return [Change("/bufferViews", "meshopt", self.views)]


@dataclass
class DracoWriter(Writer):
    """Compresses each primitive that Draco supports; rounds positions, normals and UVs.

    All primitives of a mesh share a grid of positions, so that seams between them stay closed.
    Normals are rounded to an octahedral grid of 10 bits, texture coordinates to 14 bits of their
    range. Other attributes are exact.
    """

    encoded: int = 0
    plain: list[Change] = field(default_factory=list)
    grid: Grid | None = None

    def replace_mesh(self, mesh: int, refined: Sequence[RefinedPrimitive], stages: Stages) -> int:
        """Compress the primitives of a mesh on one grid; return the number of vertices written."""
        if refined:
            positions = [primitive.attributes["POSITION"] for primitive in refined]
            self.grid = grid_of(positions)
        return super().replace_mesh(mesh, refined, stages)

    def replace(self, mesh: int, refined: RefinedPrimitive) -> int:
        """Replace the geometry of a primitive, compressed if possible; return its vertices."""
        primitive = self.tree["meshes"][mesh]["primitives"][refined.source.number]
        made = self._encoded(refined)
        if made is None:
            pointer = f"/meshes/{mesh}/primitives/{refined.source.number}"
            self.plain.append(Change(pointer, "not-draco", 1))
            return super().replace(mesh, refined)
        before = refined.source.accessors
        primitive["attributes"] = {
            name: self._described(before.get(name), name, values)
            for name, values in made.attributes.items()
        }
        indices = self.add_accessor(made.faces.reshape(-1, 1), "SCALAR", None)
        self.set_indices(primitive, indices)
        primitive.pop("mode", None)
        data = np.frombuffer(made.data, np.uint8).reshape(-1, 1)
        primitive.setdefault("extensions", {})[DRACO] = {
            "bufferView": self.add_view(self.stored(data)),
            "attributes": made.ids,
        }
        if refined.outline is not None:
            drop(primitive, OUTLINE)
            pointer = f"/meshes/{mesh}/primitives/{refined.source.number}"
            self.plain.append(Change(pointer, "outlines-reordered", 1, (OUTLINE,)))
        self.encoded += 1
        return len(made.attributes["POSITION"])

    def finish(self) -> list[bytes | memoryview]:
        """Write the length of the buffer into the tree; return the pieces of BIN."""
        if self.encoded:
            declare(self.tree, DRACO)
        return super().finish()

    def changes(self) -> list[Change]:
        """Return the number of compressed primitives, and each that was not."""
        return [*counted({"draco": self.encoded}, "/meshes"), *self.plain]

    def _encoded(self, refined: RefinedPrimitive) -> EncodedDraco | None:
        # Draco reorders vertices, and cannot hold morph targets.
        if refined.targets or self.grid is None or not can_encode(refined.attributes):
            return None
        return encode_draco(refined.attributes, refined.faces, self.grid)

    def _described(
        self, before: Accessor | None, name: str, values: Shaped[np.ndarray, "N K"]
    ) -> int:
        index = self.add_accessor(values, "SCALAR" if before is None else before.type, None)
        describe(self.tree["accessors"][index], before, name, values)
        return index


WRITERS: dict[str, type[Writer]] = {
    "none": Writer,
    "draco": DracoWriter,
    "meshopt": MeshoptWriter,
}


@dataclass(frozen=True, eq=False)
class Grid:
    """A cube, by its corner and edge length, on whose grid positions are rounded."""

    origin: Float[np.ndarray, " 3"]
    size: float

    @property
    def cell(self) -> float:
        """The distance between neighbouring positions."""
        return self.size / (2**POSITION_BITS - 1)


@dataclass(frozen=True, eq=False)
class EncodedDraco:
    """A primitive in Draco's form.

    Attributes:
        data: the bitstream.
        ids: unique ids by attribute.
        attributes, faces: the decoded data: Draco reorders, and may split or join vertices.
    """

    data: bytes
    ids: dict[str, int]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]
    faces: Int[np.ndarray, "F 3"]


def grid_of(positions: list[Float[np.ndarray, "N 3"]]) -> Grid | None:
    """Return the smallest grid over all positions of a mesh; None if Draco cannot describe it."""
    lows, highs = zip(*(extent(points) for points in positions), strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    size = float((high.astype(np.float64) - low).max())
    grid = Grid(low, size if size > 0 else 1.0)
    if grid.cell >= _WIDE_CELL:
        return grid
    if grid.size < _LEAST_SIZE:
        return None
    origin = (np.floor(low.astype(np.float64) / _TEXT_STEP - 1) * _TEXT_STEP).astype(np.float32)
    steps = np.ceil((high.astype(np.float64) - origin).max() / _TEXT_STEP + 1)
    return Grid(origin, float(steps * _TEXT_STEP))


def can_encode(attributes: dict[str, Shaped[np.ndarray, "N K"]]) -> bool:
    """Return whether Draco supports the types of all attributes."""
    return all(values.dtype in _TYPES for values in attributes.values())


def encode_draco(
    attributes: dict[str, Shaped[np.ndarray, "N K"]], faces: Int[np.ndarray, "F 3"], grid: Grid
) -> EncodedDraco | None:
    """Encode a primitive; None if Draco cannot, loses a face, or would take too long."""
    around = np.bincount(faces.reshape(-1))
    if around @ around > MOST_PAIRS:
        return None
    others = [name for name in attributes if name not in _NAMED.values()]
    generic = {
        _FIRST_GENERIC + number: np.ascontiguousarray(attributes[name])
        for number, name in enumerate(others)
    }
    try:
        data = DracoPy.encode(
            attributes["POSITION"].astype(np.float64),
            faces.astype(np.uint32),
            quantization_bits=POSITION_BITS,
            compression_level=EFFORT,
            quantization_range=grid.size,
            quantization_origin=grid.origin,
            normals=_double(attributes.get("NORMAL")),
            normal_quantization_bits=NORMAL_BITS,
            tex_coord=_double(attributes.get("TEXCOORD_0")),
            tex_coord_quantization_bits=TEXCOORD_BITS,
            generic_attributes=generic or None,
        )
    except DracoPy.EncodingFailedException:
        return None
    mesh = DracoPy.decode(data)
    if getattr(mesh, "faces", None) is None or len(mesh.faces) != len(faces):
        return None
    names = {_FIRST_GENERIC + number: name for number, name in enumerate(others)}
    encoded = {
        names.get(part["unique_id"], _NAMED.get(part["attribute_type"], "")): part
        for part in mesh.attributes
    }
    if set(encoded) != set(attributes):
        return None
    return EncodedDraco(
        data=data,
        ids={name: encoded[name]["unique_id"] for name in attributes},
        attributes={
            name: encoded[name]["data"].astype(values.dtype) for name, values in attributes.items()
        },
        faces=mesh.faces,
    )


def _double(values: Shaped[np.ndarray, "N K"] | None) -> Float[np.ndarray, "N K"] | None:
    """Return float64, which DracoPy requires here; it stores float32."""
    return None if values is None else values.astype(np.float64)
