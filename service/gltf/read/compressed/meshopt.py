"""EXT_meshopt_compression and KHR_meshopt_compression: buffer views decoded to what they stand for.

The decoders are meshoptimizer's own. They are told how much to write before they read a byte, so
that size is checked against the limits first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import meshopt
import numpy as np

from ....errors import GltfError
from ....options import Limits
from ..checks.references import refer
from ..extensions import drop, withdraw
from ..plan import check_decoded
from ..schema import Document, Index, Part, Size, checked

EXTENSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_ROW_BYTES = {"OCTAHEDRAL": (4, 8), "COLOR": (4, 8), "QUATERNION": (8,)}


class CompressedView(Part, frozen=True):
    """The extension's object in a buffer view."""

    buffer: Index
    byte_length: Size
    byte_stride: Size
    count: Size
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    byte_offset: Index = 0
    filter: Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"] = "NONE"


@dataclass(frozen=True)
class _Packed:
    number: int
    name: str
    view: CompressedView

    @property
    def pointer(self) -> str:
        return f"/bufferViews/{self.number}/extensions/{self.name}"


def needed_buffers(document: Document) -> set[int]:
    """Return the buffers that views lie in, but for compressed views, which only claim to."""
    return {
        view.buffer
        for view in document.buffer_views
        if view.extensions.keys().isdisjoint(EXTENSIONS)
    }


def decode_views(
    tree: dict[str, Any],
    document: Document,
    buffers: list[memoryview],
    size: int,
    limits: Limits,
) -> list[tuple[int, int, int]]:
    """Give every compressed view a buffer of its own with its bytes.

    Gives (buffer, start, end) of the compressed data, which nothing needs any more.

    Edits the tree and appends to `buffers`. `size` is the upload's, in bytes.

    Raises:
        GltfError: an extension object that breaks its rules, or data that do not decode.
        LimitError: the decoded bytes would take more memory than allowed.
    """
    packed = [
        _Packed(number, name, _checked_view(view.extensions[name], view.byte_length, number, name))
        for number, view in enumerate(document.buffer_views)
        if view.extensions
        for name in EXTENSIONS
        if name in view.extensions
    ]
    if packed:
        check_decoded(sum(f.view.count * f.view.byte_stride for f in packed), size, limits)
    decoded = [_decode(entry, buffers) for entry in packed]
    for entry, data in zip(packed, decoded, strict=True):
        view = tree["bufferViews"][entry.number]
        view |= {"buffer": len(buffers), "byteOffset": 0}
        drop(view, entry.name)
        tree["buffers"].append({"byteLength": len(data)})
        buffers.append(data)
    for name in EXTENSIONS:
        withdraw(tree, name)
        for buffer in tree.get("buffers", []):
            drop(buffer, name)
    return [
        (f.view.buffer, f.view.byte_offset, f.view.byte_offset + f.view.byte_length) for f in packed
    ]


def _checked_view(value: Any, length: int, number: int, name: str) -> CompressedView:
    pointer = f"/bufferViews/{number}/extensions/{name}"
    view = checked(value, CompressedView, pointer)
    stride, count = view.byte_stride, view.count
    if count * stride != length:
        raise GltfError(
            f"{count} elements of {stride} bytes in a view of {length}", pointer=f"{pointer}/count"
        )
    if view.mode == "ATTRIBUTES":
        right = (
            stride % 4 == 0 and stride <= 256 and stride in _ROW_BYTES.get(view.filter, (stride,))
        )
    else:
        right = stride in (2, 4) and view.filter == "NONE"
        right = right and (view.mode == "INDICES" or count % 3 == 0)
    if not right:
        raise GltfError(
            f"{view.mode} of {count} elements of {stride} bytes, filter {view.filter}",
            pointer=pointer,
        )
    return view


def _decode(entry: _Packed, buffers: Sequence[memoryview]) -> memoryview:
    view = entry.view
    refer(view.buffer, buffers, f"{entry.pointer}/buffer")
    end = view.byte_offset + view.byte_length
    if end > len(buffers[view.buffer]):
        raise GltfError(
            f"the data end at byte {end} of {len(buffers[view.buffer])}", pointer=entry.pointer
        )
    data = bytes(buffers[view.buffer][view.byte_offset : end])
    try:
        decoded = meshopt.decode_gltf_buffer(
            data, view.count, view.byte_stride, view.mode, view.filter
        )
    except (ValueError, RuntimeError) as error:
        raise GltfError(f"the data do not decode: {error}", pointer=entry.pointer) from error
    return np.ascontiguousarray(decoded).reshape(-1).view(np.uint8).data.cast("B")
