"""Triangle primitives as arrays: corners, and the attributes of the vertices that they use."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, Shaped

from pns_common.base.arrays import marked
from pns_common.base.distinct import as_words, distinct_rows, number_by_first_appearance

from ...errors import GltfError, UnsupportedFeature
from ..constants import FLOAT
from .accessors import read, read_rows
from .modes import TRIANGLES, triangles
from .quantization import dequantised
from .schema import Accessor, Document

_FOLLOWS_VERTEX = re.compile(r"POSITION|JOINTS_[0-9]+|WEIGHTS_[0-9]+")


@dataclass(frozen=True, eq=False)
class TrianglePrimitive:
    """A primitive, reduced to the vertices that its faces use.

    Attributes:
        number: its place in the mesh.
        rows: the accessors' elements that `attributes` hold, in ascending order.
        corners: (F, 3) rows of `attributes`.
        attributes: by name (N, K) arrays in the component type that they are written in.
        accessors: by name an accessor that describes them; one without bytes of its own where
            they were quantised.
        targets: the same of each morph target, whose values are added to the attributes'.
        target_accessors: the same of each morph target.
    """

    number: int
    rows: Int[np.ndarray, " N"]
    corners: Int[np.ndarray, "F 3"]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]
    accessors: dict[str, Accessor]
    targets: tuple[dict[str, Shaped[np.ndarray, "N K"]], ...] = ()
    target_accessors: tuple[dict[str, Accessor], ...] = ()


def read_primitive(
    document: Document, buffers: Sequence[memoryview], mesh: int, number: int
) -> TrianglePrimitive:
    """Read a primitive whose references have been checked.

    Raises:
        GltfError: an index beyond the vertices, or a NaN or infinity, with the accessor's pointer.
        UnsupportedFeature: a strip or fan of which an index restarts it.
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
                # As KHR_mesh_primitive_restart lets it, and nothing else does.
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
    )


def _read_attributes(
    document: Document,
    buffers: Sequence[memoryview],
    indices: dict[str, int],
    rows: Int[np.ndarray, " N"],
    where: str,
) -> tuple[dict[str, Shaped[np.ndarray, "N K"]], dict[str, Accessor]]:
    """Read the rows of attributes, by name, and what describes them; errors name `where` too."""
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
    """Return the used indices in ascending order, and each index's place among them.

    Costs in proportion to the indices, however many vertices the accessor has: many primitives may
    share one.
    """
    if count > 8 * len(indices):
        used = np.unique(indices)
        return used, np.searchsorted(used, indices)
    flags = marked(indices, count)
    return np.flatnonzero(flags), (np.cumsum(flags) - 1)[indices]


def distinct_corners(
    primitive: TrianglePrimitive,
    corners: Int[np.ndarray, "F 3"],
    welded: Int[np.ndarray, " N"],
) -> tuple[Int[np.ndarray, "F 3"], Int[np.ndarray, " C"]]:
    """Join vertices that agree in position and in all attributes, those of morph targets too.

    `welded` is the welded vertex of each row, and says what follows it: the position, how morph
    targets move it, the skin's binding. Gives the distinct corners of each face, numbered by
    first appearance, and for each of them a row of the primitive's attributes.
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
    return distinct.reshape(-1, 3), flat[first]
