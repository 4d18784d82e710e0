"""KHR_draco_mesh_compression: primitives decoded to plain accessors.

What the header claims is checked against the limits before the decoder sees it; what it does not
say (attributes that nobody asked for) is bounded by a ceiling on the decoder's memory.
"""

from __future__ import annotations

from typing import Any

import DracoPy
import numpy as np
from jaxtyping import Shaped

from ....errors import GltfError, LimitError
from ....options import Limits
from ...constants import COMPONENT_COUNTS, COMPONENT_TYPES, UNSIGNED_INT
from ..checks.references import refer
from ..extensions import drop, withdraw
from ..memory_cap import memory_cap
from ..modes import STRIP, TRIANGLES
from ..plan import check_decoded
from ..schema import Document, Index, Part, Primitive, checked
from .draco_header import read_header

EXTENSION = "KHR_draco_mesh_compression"

# Peak bytes while decoding, at least twice what was measured on 200,000 and 320,000 faces with
# normals and UVs (138 to 355 for each face).
BYTES_PER_FACE = 300
BYTES_PER_FACE_AND_TABLE = 120
BYTES_PER_POINT_AND_ATTRIBUTE = 80
# What the allocator may reserve beside.
SLACK = 64 * 2**20


class CompressedPrimitive(Part, frozen=True):
    """The extension's object in a primitive."""

    buffer_view: Index
    attributes: dict[str, Index]


def decode_primitives(
    tree: dict[str, Any],
    document: Document,
    buffers: list[memoryview],
    size: int,
    limits: Limits,
) -> list[int]:
    """Give every compressed primitive plain accessors; the views of the compressed data.

    Edits the tree and appends to `buffers`. Buffer views have been checked. `size` is the upload's,
    in bytes.

    Raises:
        GltfError: data that do not decode, or are not what the primitive says.
        UnsupportedFeature: another version of the bitstream.
        LimitError: decoding would take more memory than allowed.
    """
    views: list[int] = []
    held = size + sum(len(buffer) for buffer in buffers)
    for mesh_number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            if EXTENSION in primitive.extensions:
                pointer = f"/meshes/{mesh_number}/primitives/{place}"
                decoded = _decode(document, buffers, primitive, pointer, held, limits)
                entry = tree["meshes"][mesh_number]["primitives"][place]
                entry_view = entry["extensions"][EXTENSION]["bufferView"]
                _store(tree, buffers, entry, decoded)
                held += sum(values.nbytes for values in decoded.values())
                views.append(entry_view)
    withdraw(tree, EXTENSION)
    return views


def _decode(
    document: Document,
    buffers: list[memoryview],
    primitive: Primitive,
    pointer: str,
    held: int,
    limits: Limits,
) -> dict[str | None, Shaped[np.ndarray, "N K"]]:
    """Decode the attributes by name, and the indices under None."""
    here = f"{pointer}/extensions/{EXTENSION}"
    wanted = checked(primitive.extensions[EXTENSION], CompressedPrimitive, here)
    if primitive.mode not in (TRIANGLES, STRIP):
        raise GltfError("Draco holds triangles only", pointer=f"{pointer}/mode")
    refer(wanted.buffer_view, document.buffer_views, f"{here}/bufferView")
    view = document.buffer_views[wanted.buffer_view]
    data = bytes(buffers[view.buffer][view.byte_offset : view.byte_offset + view.byte_length])
    header = read_header(data, here)
    need = header.faces * (BYTES_PER_FACE + BYTES_PER_FACE_AND_TABLE * header.tables)
    need += header.points * BYTES_PER_POINT_AND_ATTRIBUTE * len(wanted.attributes)
    check_decoded(need, held, limits)
    _check_claim(document, primitive, header.faces, pointer)
    try:
        with memory_cap(need + SLACK):
            mesh = DracoPy.decode(data)
    except MemoryError as error:
        raise LimitError(
            f"the Draco data take more than {need + SLACK} bytes, which their header accounts for",
            limit="memory",
            allowed=need + SLACK,
            found=need + SLACK + 1,
        ) from error
    except (DracoPy.FileTypeException, TypeError, ValueError) as error:
        raise GltfError(f"the data do not decode: {error}", pointer=here) from error
    faces = getattr(mesh, "faces", None)
    if faces is None or not len(faces):
        raise GltfError("the Draco data hold no triangle", pointer=here)
    decoded: dict[str | None, Shaped[np.ndarray, "N K"]] = {None: faces.reshape(-1, 1)}
    data_of = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
    for name, identity in wanted.attributes.items():
        index = primitive.attributes.get(name)
        if index is None or index >= len(document.accessors):
            raise GltfError(f"{name} has no accessor", pointer=f"{here}/attributes")
        accessor = document.accessors[index]
        values = data_of.get(identity)
        if values is None or values.shape[1] != COMPONENT_COUNTS[accessor.type]:
            raise GltfError(
                f"the Draco data hold no {accessor.type} under {identity}, for {name}",
                pointer=f"{here}/attributes",
            )
        decoded[name] = _as_type(values, COMPONENT_TYPES[accessor.component_type], index)
    return decoded


def _check_claim(document: Document, primitive: Primitive, faces: int, pointer: str) -> None:
    """Refuse more triangles than the primitive says: a job is measured, and paid for, by that."""
    index = primitive.indices
    if index is None or index >= len(document.accessors):
        raise GltfError("compressed triangles need indices", pointer=pointer)
    corners = document.accessors[index].count
    claimed = corners // 3 if primitive.mode == TRIANGLES else corners - 2
    if faces > claimed:
        raise GltfError(
            f"the Draco data hold {faces} triangles, the indices are those of {claimed}",
            pointer=f"/accessors/{index}/count",
        )


def _as_type(
    values: Shaped[np.ndarray, "N K"], dtype: np.dtype[Any], index: int
) -> Shaped[np.ndarray, "N K"]:
    """Return the values in the accessor's component type, which must be able to hold them."""
    if dtype.kind != "f":
        bounds = np.iinfo(dtype)
        # The decoder hands normalised integers back as floats that are whole.
        whole = values.dtype.kind in "iu" or bool((values == np.rint(values)).all())
        if not whole or values.min() < bounds.min or values.max() > bounds.max:
            raise GltfError(
                f"the Draco values do not fit {dtype.name}",
                pointer=f"/accessors/{index}/componentType",
            )
    return np.ascontiguousarray(values, dtype=dtype)


def _store(
    tree: dict[str, Any],
    buffers: list[memoryview],
    primitive: dict[str, Any],
    decoded: dict[str | None, Shaped[np.ndarray, "N K"]],
) -> None:
    """Make new accessors for one primitive: the old ones may serve another."""
    for name, values in decoded.items():
        accessors = tree["accessors"]
        holder, key = (primitive, "indices") if name is None else (primitive["attributes"], name)
        gone = ("bufferView", "byteOffset", "sparse")
        accessor = {k: value for k, value in accessors[holder[key]].items() if k not in gone}
        if name is None:
            accessor |= {"componentType": UNSIGNED_INT, "type": "SCALAR"}
        holder[key] = len(accessors)
        data = values.data.cast("B")
        accessor |= {"bufferView": len(tree["bufferViews"]), "count": len(values)}
        accessors.append(accessor)
        tree["bufferViews"].append({"buffer": len(buffers), "byteLength": len(data)})
        tree["buffers"].append({"byteLength": len(data)})
        buffers.append(data)
    primitive.pop("mode", None)
    drop(primitive, EXTENSION)
