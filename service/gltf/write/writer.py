"""Write refined primitives into a document: new accessors at the end, the rest unchanged."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from jaxtyping import Int, Shaped

from pns_common.mesh.rows import extent

from ...changes import Change
from ...stages import Stages
from ..constants import (
    ARRAY_BUFFER,
    COLUMNS,
    COMPONENT_TYPES,
    ELEMENT_ARRAY_BUFFER,
    OUTLINE,
    TRIANGLES,
    UNSIGNED_INT,
    WIDEST,
)
from ..read.compressed import DRACO
from ..read.extensions import drop
from ..read.plan import Spare
from ..read.schema import Accessor
from ..refine.attributes import RefinedPrimitive
from .prune import cut, moved, remove_unused

# 65535 restarts primitives.
LARGEST_UINT16_INDEX = 65534

# Properties that a new accessor of indices keeps.
KEPT = ("name", "extras")

# Properties of a primitive that name accessors.
GEOMETRY = ("attributes", "targets", "indices")

_COMPONENT_TYPE_OF = {dtype: number for number, dtype in COMPONENT_TYPES.items()}


@dataclass
class Writer:
    """A document being edited: the JSON tree, and the pieces of its only buffer.

    `in_order`: whether triangles must keep the order of their corners, which compression may turn.
    """

    tree: dict[str, Any]
    pieces: list[bytes | memoryview] = field(default_factory=list)
    length: int = 0
    starts: list[int] = field(default_factory=list)
    in_order: bool = False

    @classmethod
    def start(cls, tree: dict[str, Any], buffers: Sequence[memoryview]) -> Self:
        """Return a writer that has joined all buffers of a tree into the first."""
        writer = cls(tree)
        writer.starts = [writer.append(buffer, WIDEST) for buffer in buffers]
        for view in tree.get("bufferViews", []):
            if view["buffer"]:
                view["byteOffset"] = view.get("byteOffset", 0) + writer.starts[view["buffer"]]
                view["buffer"] = 0
        return writer

    def replace_mesh(self, mesh: int, refined: Sequence[RefinedPrimitive], stages: Stages) -> int:
        """Replace the geometry of a mesh; return the number of vertices written."""
        vertices = 0
        for number, primitive in enumerate(refined):
            stages.reach(number / len(refined))
            vertices += self.replace(mesh, primitive)
        return vertices

    def repeat_mesh(self, mesh: int, first: int, refined: Sequence[RefinedPrimitive]) -> None:
        """Give primitives the new geometry of the primitives with their numbers in another mesh."""
        meshes = self.tree["meshes"]
        for number in (primitive.source.number for primitive in refined):
            primitive, like = (meshes[place]["primitives"][number] for place in (mesh, first))
            shared = {key: like[key] for key in GEOMETRY if key in like}
            primitive.update(deepcopy(shared))
            _name_triangles(primitive)
            if OUTLINE in primitive.get("extensions", {}):
                drop(primitive, OUTLINE)
            if OUTLINE in like.get("extensions", {}):
                outline = deepcopy(like["extensions"][OUTLINE])
                primitive.setdefault("extensions", {})[OUTLINE] = outline
            if DRACO in like.get("extensions", {}):
                data = deepcopy(like["extensions"][DRACO])
                primitive.setdefault("extensions", {})[DRACO] = data

    def changes(self) -> list[Change]:
        """Return the changes that writing made."""
        return []

    def replace(self, mesh: int, refined: RefinedPrimitive) -> int:
        """Replace the geometry of a primitive; return the number of vertices written."""
        primitive = self.tree["meshes"][mesh]["primitives"][refined.source.number]
        primitive["attributes"] = {
            name: self._attribute(refined.source.accessors.get(name), name, values)
            for name, values in refined.attributes.items()
        }
        if refined.targets:
            primitive["targets"] = [
                {name: self._deltas(before[name], name, values[name]) for name in before}
                for before, values in zip(
                    refined.source.target_accessors, refined.targets, strict=True
                )
            ]
        _name_triangles(primitive)
        count = len(refined.attributes["POSITION"])
        indices = as_indices(refined.faces, count).reshape(-1, 1)
        self.set_indices(primitive, self._accessor(indices, ELEMENT_ARRAY_BUFFER, "SCALAR"))
        if refined.outline is not None:
            self._set_outline(primitive, as_indices(refined.outline, count))
        return count

    def _set_outline(self, primitive: dict[str, Any], pairs: Shaped[np.ndarray, "N 2"]) -> None:
        """Set the pairs of an outline; without any it goes."""
        if not len(pairs):
            drop(primitive, OUTLINE)
            return
        values = np.ascontiguousarray(pairs).reshape(-1, 1)
        # Compression of indices is for triangles.
        view = Writer.stored(self, values) | {"target": ELEMENT_ARRAY_BUFFER}
        index = self.add_accessor(values, "SCALAR", self.add_view(view))
        primitive["extensions"][OUTLINE]["indices"] = index

    def set_indices(self, primitive: dict[str, Any], index: int) -> None:
        """Set a primitive's indices; their accessor keeps the name and extras of the old one."""
        accessors, old = self.tree["accessors"], primitive.get("indices")
        if old is not None:
            before = accessors[old]
            accessors[index] |= {key: before[key] for key in KEPT if key in before}
        primitive["indices"] = index

    def remove(self, spare: Spare) -> None:
        """Remove spare data that is no longer used from the tree and from BIN."""
        gone = remove_unused(self.tree, spare)
        gone += [
            (self.starts[buffer] + start, self.starts[buffer] + end)
            for buffer, start, end in spare.ranges
        ]
        views = self.tree.get("bufferViews", [])
        stored = [self.bytes_of(view) for view in views]
        starts = [place.get("byteOffset", 0) for place in stored]
        ends = [start + place["byteLength"] for start, place in zip(starts, stored, strict=True)]
        went = np.array(gone, dtype=np.int64).reshape(-1, 2)
        needed = np.array([starts, ends], dtype=np.int64).T
        self.pieces, shifts = cut(self.pieces, went, needed)
        for place, start in zip(stored, moved(starts, shifts), strict=True):
            if "byteOffset" in place:
                place["byteOffset"] = start
        self.length = sum(len(piece) for piece in self.pieces)

    def bytes_of(self, view: dict[str, Any]) -> dict[str, Any]:
        """Return the object with the byteOffset and byteLength of a view's bytes in BIN."""
        return view

    def finish(self) -> list[bytes | memoryview]:
        """Write the length of the buffer into the tree; return the pieces of BIN."""
        if not self.pieces:
            return []
        self.append(memoryview(b""), WIDEST)
        first = self.tree.get("buffers", [{}])[0]
        rest = {key: value for key, value in first.items() if key not in ("uri", "byteLength")}
        self.tree["buffers"] = [{"byteLength": self.length, **rest}]
        return self.pieces

    def _attribute(
        self, before: Accessor | None, name: str, values: Shaped[np.ndarray, "N K"]
    ) -> int:
        kind = "SCALAR" if before is None else before.type
        index = self._accessor(values, ARRAY_BUFFER, kind)
        describe(self.tree["accessors"][index], before, name, values)
        return index

    def _deltas(self, before: Accessor, name: str, values: Shaped[np.ndarray, "N K"]) -> int:
        """Write the deltas of a morph target, sparse if they were and that is smaller."""
        rows = np.flatnonzero(values.any(axis=1)).astype(np.uint32)
        moved = values[rows]
        smaller = rows.nbytes + moved.nbytes < values.nbytes
        if before.sparse is None or values.itemsize != rows.itemsize or not smaller:
            return self._attribute(before, name, values)
        index = self.add_accessor(values, before.type, None)
        accessor = self.tree["accessors"][index]
        if len(rows):
            places, content = (in_words(part, "") for part in (rows[:, None], moved))
            accessor["sparse"] = {
                "count": len(rows),
                "indices": {
                    "bufferView": self.add_view(self.stored(places)),
                    "componentType": UNSIGNED_INT,
                },
                "values": {"bufferView": self.add_view(self.stored(content))},
            }
        describe(accessor, before, name, values)
        return index

    def _accessor(self, values: Shaped[np.ndarray, "N K"], target: int, kind: str) -> int:
        """Append elements; return the index of their accessor."""
        vertices = target == ARRAY_BUFFER
        content = in_words(values, kind) if vertices else np.ascontiguousarray(values)
        view = self.stored(content)
        padded = vertices and content.shape[1] != values.shape[1] * values.itemsize
        # A matrix includes the padding of its columns.
        if padded and kind not in COLUMNS:
            view["byteStride"] = content.shape[1]
        view["target"] = target
        return self.add_accessor(values, kind, self.add_view(view))

    def stored(self, content: Shaped[np.ndarray, "N B"]) -> dict[str, Any]:
        """Append elements; return a buffer view of them."""
        data = content.data.cast("B")
        return {"buffer": 0, "byteOffset": self.append(data), "byteLength": len(data)}

    def add_view(self, view: dict[str, Any]) -> int:
        """Add a buffer view; return its index."""
        views = self.tree.setdefault("bufferViews", [])
        views.append(view)
        return len(views) - 1

    def add_accessor(self, values: Shaped[np.ndarray, "N K"], kind: str, view: int | None) -> int:
        """Add an accessor; return its index. `view` None: it gets no buffer view."""
        accessors = self.tree.setdefault("accessors", [])
        place = {} if view is None else {"bufferView": view}
        accessors.append(
            {
                **place,
                "componentType": _COMPONENT_TYPE_OF[values.dtype],
                "count": len(values),
                "type": kind,
            }
        )
        return len(accessors) - 1

    def append(self, data: memoryview, alignment: int = 4) -> int:
        """Append bytes at a multiple of `alignment`; return where they begin."""
        padding = -self.length % alignment
        if padding:
            self.pieces.append(b"\0" * padding)
        start = self.length + padding
        self.pieces.append(data)
        self.length = start + len(data)
        return start


def _name_triangles(primitive: dict[str, Any]) -> None:
    """Set the mode of a primitive, which may have been a strip or fan, to triangles."""
    if primitive.get("mode", TRIANGLES) != TRIANGLES:
        primitive["mode"] = TRIANGLES


def describe(
    accessor: dict[str, Any], before: Accessor | None, name: str, values: Shaped[np.ndarray, "N K"]
) -> None:
    """Give an attribute's accessor the properties of the old one, and its bounds to POSITION."""
    if before is not None:
        if before.normalized:
            accessor["normalized"] = True
        # Some readers take the name of a morph target from its accessor.
        given = {"name": before.name, "extras": before.extras}
        accessor.update({key: value for key, value in given.items() if value is not None})
    if name == "POSITION":
        accessor["min"], accessor["max"] = (bound.tolist() for bound in extent(values))


def as_indices(faces: Int[np.ndarray, "F 3"], count: int) -> Shaped[np.ndarray, "F 3"]:
    """Return indices of `count` vertices in the narrowest type; int32 is not copied."""
    if count - 1 <= LARGEST_UINT16_INDEX:
        return faces.astype(np.uint16)
    return faces.view(np.uint32) if faces.dtype == np.int32 else faces.astype(np.uint32)


def in_words(values: Shaped[np.ndarray, "N K"], kind: str) -> Shaped[np.ndarray, "N B"]:
    """Return rows as bytes; rows, and columns of a matrix, are padded to four bytes."""
    narrow = np.ascontiguousarray(values)
    if narrow.itemsize == 4:
        return narrow.view(np.uint8).reshape(len(values), -1)
    columns = narrow.view(np.uint8).reshape(len(values), COLUMNS.get(kind, 1), -1)
    padding = -columns.shape[2] % 4
    return np.pad(columns, ((0, 0), (0, 0), (0, padding))).reshape(len(values), -1)
