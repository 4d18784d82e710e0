"""Check features: breaches of glTF 2.0 to report, and features that cannot be refined."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from ...changes import Change
from ...errors import GltfError, UnsupportedFeature
from ..constants import COMPONENT_TYPES, FLOAT, SURFACES, UNSIGNED_BYTE, UNSIGNED_SHORT
from .accessors import QUANTIZATION, allowed, is_dequantised, needs_extension
from .container import escaped
from .extensions import KNOWN
from .schema import Accessor, Asset, Document, Primitive, checked

LEAST_STRIDE, MOST_STRIDE = 4, 252
_COLOUR, _MESHES, _TARGETS, _STRIDE, _ALIGNMENT, _QUANTIZED = (
    "integers in COLOR_n that are not normalized; averaged as colours",
    "meshes without primitives",
    "morph targets that not all primitives of a mesh have; the others stay where they are",
    "a byteStride that is not a multiple of 4 from 4 to 252; 0 read as packed",
    "elements that do not begin at a multiple of their components' size",
    f"integers that need {QUANTIZATION}, which extensionsUsed does not name",
)

# Extensions of primitives that number vertices or faces; refined ones have other numbers.
_BY_NUMBER = ("EXT_mesh_primitive_edge_visibility",)
# In this one the numbers of vertices are the ids of a set without a source.
_FEATURES, _SOURCES = "EXT_mesh_features", {"attribute", "texture"}
# ASCII digits without leading zeros, so that each number has one name.
_SKIN_SET = re.compile(r"(JOINTS|WEIGHTS)_(0|[1-9][0-9]{0,2})")
_AT_MOST_2_0 = re.compile(r"[01]\.[0-9]+|2\.0")
_SKIN_NAMES = ("JOINTS_", "WEIGHTS_")
_PARTNER = {"JOINTS": "WEIGHTS", "WEIGHTS": "JOINTS"}
_INTEGERS = (UNSIGNED_BYTE, UNSIGNED_SHORT)
_SKIN_STORAGE = {
    "JOINTS": {(kind, False) for kind in _INTEGERS},
    "WEIGHTS": {(FLOAT, False), *((kind, True) for kind in _INTEGERS)},
}
# Types of attributes and of morph deltas; `_n` stands for any number.
_DELTAS = {"POSITION": "VEC3", "NORMAL": "VEC3", "TANGENT": "VEC3", "TEXCOORD_n": "VEC2"}
_GEOMETRY = _DELTAS | {"TANGENT": "VEC4", "JOINTS_n": "VEC4", "WEIGHTS_n": "VEC4"}


def breaches(document: Document) -> list[Change]:
    """Return a change for each kind of breach of glTF 2.0, with its first place and its count.

    They leave the surface in no doubt and most viewers accept them. What leaves it in doubt (a
    dangling index, a cycle of nodes, a NaN) is refused.
    """
    first: dict[str, str] = {}
    counts: dict[str, int] = {}
    for what, pointer in _all(document):
        first.setdefault(what, pointer)
        counts[what] = counts.get(what, 0) + 1
    return [Change(first[what], "breach", counts[what], (what,)) for what in counts]


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
    """Yield breaches of accessors as attributes; each pair of name and accessor is checked once."""
    declared = QUANTIZATION in document.extensions_used
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


def refuse_version(tree: dict[str, Any]) -> None:
    """Refuse versions other than 2, and minimum versions above 2.0, before reading the rest.

    Raises:
        UnsupportedFeature: another version.
        GltfError: no version.
    """
    asset = checked(tree.get("asset", {}), Asset, "/asset")
    if asset.version.partition(".")[0] != "2":
        raise UnsupportedFeature(f"glTF version {asset.version[:16]}", pointer="/asset/version")
    least = asset.min_version
    if least is not None and not _AT_MOST_2_0.fullmatch(least):
        what = f"what needs glTF version {least[:16]} at least"
        raise UnsupportedFeature(what, pointer="/asset/minVersion")


def refuse_features(document: Document) -> None:
    """Refuse triangle primitives that refinement would leave incomplete; references are checked.

    Raises:
        UnsupportedFeature: no POSITION, or one that only an unknown extension holds; weights of
            several types; an extension that numbers vertices or faces.
        GltfError: an attribute of a type that glTF does not allow.
    """
    for number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            if primitive.mode in SURFACES:
                _refuse_primitive(document, primitive, f"/meshes/{number}/primitives/{place}")


def _refuse_primitive(document: Document, primitive: Primitive, pointer: str) -> None:
    for name in _BY_NUMBER:
        if name in primitive.extensions:
            raise UnsupportedFeature(name, pointer=f"{pointer}/extensions/{name}")
    _refuse_numbered_features(primitive.extensions.get(_FEATURES), f"{pointer}/extensions")
    if "POSITION" not in primitive.attributes:
        raise UnsupportedFeature("a primitive without POSITION", pointer=f"{pointer}/attributes")
    _refuse_unknown_compression(document, primitive, pointer)
    for name, index in primitive.attributes.items():
        pair = _SKIN_SET.fullmatch(name)
        if pair is None and name.startswith(_SKIN_NAMES):
            raise GltfError(
                "the number of a set of joints is 0 to 999, without zeros in front",
                pointer=f"{pointer}/attributes/{escaped(name)}",
            )
        _refuse_type(name, document.accessors[index], _GEOMETRY, f"/accessors/{index}")
        if pair and f"{_PARTNER[pair[1]]}_{pair[2]}" not in primitive.attributes:
            raise GltfError(
                f"{name} without {_PARTNER[pair[1]]}_{pair[2]}",
                pointer=f"{pointer}/attributes/{name}",
            )
    storages = {
        (document.accessors[index].component_type, document.accessors[index].normalized)
        for name, index in primitive.attributes.items()
        if name.startswith("WEIGHTS_")
    }
    if len(storages) > 1:
        # No rounding makes them add up to 1.
        raise UnsupportedFeature(
            "WEIGHTS_n of different component types", pointer=f"{pointer}/attributes"
        )
    for target in primitive.targets:
        for name, index in target.items():
            _refuse_type(name, document.accessors[index], _DELTAS, f"/accessors/{index}")


def _refuse_unknown_compression(document: Document, primitive: Primitive, pointer: str) -> None:
    """Refuse positions that only an unknown extension holds; without it glTF reads zeros."""
    positions = document.accessors[primitive.attributes["POSITION"]]
    unknown = sorted(primitive.extensions.keys() - KNOWN)
    if unknown and positions.buffer_view is None and positions.sparse is None:
        raise UnsupportedFeature(
            f"a primitive whose positions lie in {' or '.join(unknown)} alone",
            pointer=f"{pointer}/extensions",
        )


def _refuse_numbered_features(features: Any, pointer: str) -> None:
    sets = features.get("featureIds") if isinstance(features, dict) else None
    for place, entry in enumerate(sets if isinstance(sets, list) else []):
        if isinstance(entry, dict) and _SOURCES.isdisjoint(entry):
            raise UnsupportedFeature(
                f"{_FEATURES} by the numbers of vertices",
                pointer=f"{pointer}/{_FEATURES}/featureIds/{place}",
            )


def _refuse_type(name: str, accessor: Accessor, types: dict[str, str], pointer: str) -> None:
    expected = types.get(name, types.get(name.partition("_")[0] + "_n", accessor.type))
    if accessor.type != expected:
        raise GltfError(f"{name} must be {expected}", pointer=f"{pointer}/type")
    storage = (accessor.component_type, accessor.normalized)
    if storage not in _SKIN_STORAGE.get(name.partition("_")[0], {storage}):
        raise GltfError(
            f"{name} may not be stored as this type", pointer=f"{pointer}/componentType"
        )
    if accessor.component_type == FLOAT:
        return
    if is_dequantised(name) and storage not in allowed(name):
        raise GltfError(
            f"{name} may not be stored as integers of this type", pointer=f"{pointer}/componentType"
        )
