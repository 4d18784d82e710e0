"""Read triangle primitives as arrays: corners, attributes and morph targets of used vertices."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, Shaped

from pns_common.mesh.rows import as_words, distinct_rows, marked, number_by_first_appearance

from ...errors import GltfError, UnsupportedFeature
from ..constants import FAN, FLOAT, NGONS, TRIANGLES
from .accessors import dequantised, read, read_rows
from .schema import Accessor, Document, Primitive

_FOLLOWS_VERTEX = re.compile(r"POSITION|JOINTS_[0-9]+|WEIGHTS_[0-9]+")


@dataclass(frozen=True, eq=False)
class TrianglePrimitive:
    """A triangle primitive without the vertices that no face uses.

    Attributes:
        number: its place in the mesh.
        rows: elements of the accessors that `attributes` hold, ascending.
        corners: (F, 3) rows of `attributes`.
        attributes: (N, K) arrays by name, in the component type in which they are written.
        accessors: descriptions of these by name; without bytes for dequantised ones.
        targets: for each morph target, arrays by name that are added to the attributes.
        target_accessors: for each morph target, descriptions by name.
        positions: the number of the accessor of positions, whose elements `rows` are.
        outline: pairs of elements of the accessors between which lines are drawn; None: none.
        ngons: whether successive triangles that begin with one vertex are one polygon.
    """

    number: int
    rows: Int[np.ndarray, " N"]
    corners: Int[np.ndarray, "F 3"]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]
    accessors: dict[str, Accessor]
    targets: tuple[dict[str, Shaped[np.ndarray, "N K"]], ...] = ()
    target_accessors: tuple[dict[str, Accessor], ...] = ()
    positions: int = 0
    ngons: bool = False
    outline: Int[np.ndarray, "N 2"] | None = None

    @property
    def is_double(self) -> bool:
        """True where positions are doubles, as in text files; those of a glTF never are."""
        return self.attributes["POSITION"].itemsize == 8


def read_primitive(
    document: Document, buffers: Sequence[memoryview], mesh: int, number: int
) -> TrianglePrimitive:
    """Read a primitive whose references have been checked.

    Raises:
        GltfError: an index beyond the vertices, a NaN, an infinity or a negative weight.
        UnsupportedFeature: an index that restarts a strip or fan.
    """
    primitive = document.meshes[mesh].primitives[number]
    where = f"/meshes/{mesh}/primitives/{number}"
    count = document.accessors[primitive.attributes["POSITION"]].count
    if primitive.indices is None:
        flat = np.arange(count, dtype=np.int64)
    else:
        stored = read(document, buffers, primitive.indices)[:, 0]
        flat = stored.astype(np.int64)
        if flat.max() >= count:
            pointer = f"/accessors/{primitive.indices}"
            if primitive.mode != TRIANGLES and flat.max() == np.iinfo(stored.dtype).max:
                # KHR_mesh_primitive_restart allows it.
                raise UnsupportedFeature("a strip or fan with restarts", pointer=pointer)
            raise GltfError(
                f"{where} has index {flat.max()}, but there are {count} vertices", pointer=pointer
            )
    used, corners = compact(flat, count)
    attributes, accessors = _read_attributes(
        document, buffers, primitive.attributes, used, f"{where}/attributes"
    )
    targets = [
        _read_attributes(document, buffers, target, used, f"{where}/targets/{place}")
        for place, target in enumerate(primitive.targets)
    ]
    return TrianglePrimitive(
        number=number,
        rows=used,
        corners=triangles(corners, primitive.mode),
        attributes=attributes,
        accessors=accessors,
        targets=tuple(values for values, _ in targets),
        target_accessors=tuple(described for _, described in targets),
        positions=primitive.attributes["POSITION"],
        ngons=NGONS in primitive.extensions and primitive.mode == TRIANGLES,
        outline=_read_outline(document, buffers, primitive, count),
    )


def _read_outline(
    document: Document, buffers: Sequence[memoryview], primitive: Primitive, count: int
) -> Int[np.ndarray, "N 2"] | None:
    index = primitive.outline
    if index is None:
        return None
    pairs = read(document, buffers, index).astype(np.int64).reshape(-1, 2)
    if pairs.max(initial=0) >= count:
        what = f"an outline has index {pairs.max()}, but there are {count} vertices"
        raise GltfError(what, pointer=f"/accessors/{index}")
    return pairs


def triangles(corners: Int[np.ndarray, " C"], mode: int) -> Int[np.ndarray, "F 3"]:
    """Return the corners of each triangle, in the order of glTF 2.0 §3.7.2.1."""
    if mode == TRIANGLES:
        return corners.reshape(-1, 3)
    step = np.arange(len(corners) - 2)
    if mode == FAN:
        places = np.stack([step + 1, step + 2, np.zeros_like(step)], axis=1)
    else:
        odd = step % 2
        places = np.stack([step, step + 1 + odd, step + 2 - odd], axis=1)
    return corners[places]


def _read_attributes(
    document: Document,
    buffers: Sequence[memoryview],
    indices: dict[str, int],
    rows: Int[np.ndarray, " N"],
    where: str,
) -> tuple[dict[str, Shaped[np.ndarray, "N K"]], dict[str, Accessor]]:
    """Read rows of attributes and the descriptions of these, by name; errors name `where`."""
    attributes: dict[str, Shaped[np.ndarray, "N K"]] = {}
    accessors: dict[str, Accessor] = {}
    for name, index in indices.items():
        accessor = document.accessors[index]
        values = read_rows(document, buffers, index, rows)
        if accessor.component_type == FLOAT and not np.isfinite(values).all():
            raise GltfError(f"{where}/{name} holds NaN or infinity", pointer=f"/accessors/{index}")
        if name.startswith("WEIGHTS_") and accessor.component_type == FLOAT and (values < 0).any():
            raise GltfError(f"{where}/{name} holds negative weights", pointer=f"/accessors/{index}")
        attributes[name], accessors[name] = dequantised(name, values, accessor)
    return attributes, accessors


def compact(
    indices: Int[np.ndarray, " C"], count: int
) -> tuple[Int[np.ndarray, " U"], Int[np.ndarray, " C"]]:
    """Return the used indices, ascending, and the place of each index among them.

    The cost is proportional to the indices, not to the vertices of the accessor, which many
    primitives may share.
    """
    if count > 8 * len(indices):
        used = np.unique(indices)
        return used, np.searchsorted(used, indices)
    flags = marked(indices, count)
    return np.flatnonzero(flags), (np.cumsum(flags) - 1)[indices]


def distinct_corners(
    primitive: TrianglePrimitive,
    corners: Int[np.ndarray, "*H"],
    welded: Int[np.ndarray, " N"],
) -> tuple[Int[np.ndarray, "*H"], Int[np.ndarray, " C"]]:
    """Join rows that agree in position and in all attributes and morph targets.

    `welded` is the welded vertex of each row; rows of one agree in position, position deltas and
    skin. Returns the distinct corner at each corner, numbered by first appearance, and for each
    distinct corner a row of the attributes.
    """
    others = [
        values
        for attributes in (primitive.attributes, *primitive.targets)
        for name, values in attributes.items()
        if not _FOLLOWS_VERTEX.fullmatch(name)
    ]
    words = np.hstack([welded.astype(np.uint32)[:, None], *(as_words(o) for o in others)])
    flat = corners.reshape(-1)
    distinct, first = number_by_first_appearance(distinct_rows(words)[flat])
    return distinct.reshape(corners.shape), flat[first]
