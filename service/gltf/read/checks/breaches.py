"""What breaks glTF 2.0 and changes nothing for what refinement means: reported as found, and left.

A file with such a breach opens in most viewers, and its surface is in no doubt. What leaves it in
doubt (a dangling index, a node inside itself, values that are not finite) is refused elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator

from ....report import Change
from ...constants import COMPONENT_TYPES, FLOAT
from ..quantization import EXTENSION, needs_extension
from ..schema import Document

LEAST_STRIDE, MOST_STRIDE = 4, 252
_COLOUR, _MESHES, _TARGETS, _STRIDE, _ALIGNMENT, _QUANTIZED = (
    "integers in COLOR_n that are not normalized; averaged as colours",
    "meshes without primitives",
    "morph targets that not all primitives of a mesh have; the others stay where they are",
    "a byteStride that is not a multiple of 4 from 4 to 252; 0 read as packed",
    "elements that do not begin at a multiple of their components' size",
    f"integers that need {EXTENSION}, which extensionsUsed does not name",
)


def breaches(document: Document) -> list[Change]:
    """Return one change for each kind: where it is first, and how often."""
    first: dict[str, str] = {}
    counts: dict[str, int] = {}
    for what, pointer in _all(document):
        first.setdefault(what, pointer)
        counts[what] = counts.get(what, 0) + 1
    return [Change(first[what], f"found, and left: {what}", counts[what]) for what in counts]


def _all(document: Document) -> Iterator[tuple[str, str]]:
    for number, view in enumerate(document.buffer_views):
        stride = view.byte_stride
        if stride is not None and (stride % 4 or not LEAST_STRIDE <= stride <= MOST_STRIDE):
            yield _STRIDE, f"/bufferViews/{number}/byteStride"
    for number, accessor in enumerate(document.accessors):
        if accessor.buffer_view is not None:
            start = document.buffer_views[accessor.buffer_view].byte_offset + accessor.byte_offset
            if start % COMPONENT_TYPES[accessor.component_type].itemsize:
                yield _ALIGNMENT, f"/accessors/{number}"
    for number, mesh in enumerate(document.meshes):
        if not mesh.primitives:
            yield _MESHES, f"/meshes/{number}"
        if len({len(primitive.targets) for primitive in mesh.primitives}) > 1:
            yield _TARGETS, f"/meshes/{number}"
    yield from _attributes(document)


def _attributes(document: Document) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with accessors as attributes; each is looked at once a name."""
    declared = EXTENSION in document.extensions_used
    used = {
        entry: None
        for mesh in document.meshes
        for primitive in mesh.primitives
        for entry in primitive.named
    }
    for name, index in used:
        accessor = document.accessors[index]
        kind, normalized = accessor.component_type, accessor.normalized
        if name.startswith("COLOR_") and kind != FLOAT and not normalized:
            yield _COLOUR, f"/accessors/{index}"
        if not declared and needs_extension(name, kind, normalized=normalized):
            yield _QUANTIZED, f"/accessors/{index}"
