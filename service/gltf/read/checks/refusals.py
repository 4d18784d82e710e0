"""What a correct glTF may hold and cannot be refined yet: refused by name, so nothing is lost."""

from __future__ import annotations

import re
from typing import Any

from ....errors import GltfError, UnsupportedFeature
from ...constants import FLOAT, UNSIGNED_BYTE, UNSIGNED_SHORT
from ..index_references import KNOWN
from ..json_text import escaped
from ..modes import SURFACES
from ..quantization import allowed, is_dequantised
from ..schema import Accessor, Asset, Document, Primitive, checked

# Extensions of primitives that name vertices or faces by number: refined ones have other numbers.
_BY_NUMBER = ("CESIUM_primitive_outline", "EXT_mesh_primitive_edge_visibility")
# This one does so where a set of feature ids has no source: the vertices' numbers are the ids.
_FEATURES, _SOURCES = "EXT_mesh_features", {"attribute", "texture"}
# No zeros in front, no digits of other scripts: two names of one number would be two attributes.
_SKIN_SET = re.compile(r"(JOINTS|WEIGHTS)_(0|[1-9][0-9]{0,2})")
_AT_MOST_2_0 = re.compile(r"[01]\.[0-9]+|2\.0")
_SKIN_NAMES = ("JOINTS_", "WEIGHTS_")
_PARTNER = {"JOINTS": "WEIGHTS", "WEIGHTS": "JOINTS"}
_INTEGERS = (UNSIGNED_BYTE, UNSIGNED_SHORT)
_SKIN_STORAGE = {
    "JOINTS": {(kind, False) for kind in _INTEGERS},
    "WEIGHTS": {(FLOAT, False), *((kind, True) for kind in _INTEGERS)},
}
# The types of attributes and of what morph targets add to them; `_n` stands for any number.
_DELTAS = {"POSITION": "VEC3", "NORMAL": "VEC3", "TANGENT": "VEC3", "TEXCOORD_n": "VEC2"}
_GEOMETRY = _DELTAS | {"TANGENT": "VEC4", "JOINTS_n": "VEC4", "WEIGHTS_n": "VEC4"}


def refuse_version(tree: dict[str, Any]) -> None:
    """Refuse another version of glTF, and what a reader of version 2.0 is not to read.

    It comes before the document has been looked at: nothing else in it need be as in 2.0.

    Raises:
        UnsupportedFeature: it is one.
        GltfError: it does not say.
    """
    asset = checked(tree.get("asset", {}), Asset, "/asset")
    if asset.version.partition(".")[0] != "2":
        raise UnsupportedFeature(f"glTF version {asset.version[:16]}", pointer="/asset/version")
    least = asset.min_version
    if least is not None and not _AT_MOST_2_0.fullmatch(least):
        what = f"what needs glTF version {least[:16]} at least"
        raise UnsupportedFeature(what, pointer="/asset/minVersion")


def refuse_features(document: Document) -> None:
    """Refuse primitives of surfaces that would come back incomplete; references are checked.

    Raises:
        UnsupportedFeature: no POSITION, or one in an unknown extension alone, weights of several
            types, or an extension that names vertices or faces by number.
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
        # No rounding would let them add up to one.
        raise UnsupportedFeature(
            "WEIGHTS_n of different component types", pointer=f"{pointer}/attributes"
        )
    for target in primitive.targets:
        for name, index in target.items():
            _refuse_type(name, document.accessors[index], _DELTAS, f"/accessors/{index}")


def _refuse_unknown_compression(document: Document, primitive: Primitive, pointer: str) -> None:
    """Refuse positions that only an unknown extension can hold; glTF reads zeros in their place."""
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
