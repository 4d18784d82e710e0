"""KHR_mesh_quantization: integers in place of float32, which refinement needs back."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from jaxtyping import Shaped

from ..constants import BYTE, FLOAT, SHORT, UNSIGNED_BYTE, UNSIGNED_SHORT
from .schema import Accessor

EXTENSION = "KHR_mesh_quantization"

# (component type, normalized) that glTF 2.0 allows without the extension, where it allows integers.
_CORE_TEXCOORD = {(UNSIGNED_BYTE, True), (UNSIGNED_SHORT, True)}
_SIGNED_FRACTIONS = {(BYTE, True), (SHORT, True)}
_ALL = {(kind, flag) for kind in range(BYTE, UNSIGNED_SHORT + 1) for flag in (False, True)}


def is_dequantised(name: str) -> bool:
    """Return whether an attribute is written as float32, however it was stored."""
    return name in ("POSITION", "NORMAL", "TANGENT") or name.startswith("TEXCOORD_")


def allowed(name: str) -> set[tuple[int, bool]]:
    """Return an attribute's integer encodings by the extension: (component type, normalized)."""
    return _SIGNED_FRACTIONS if name in ("NORMAL", "TANGENT") else _ALL


def needs_extension(name: str, component_type: int, *, normalized: bool) -> bool:
    """Return whether an attribute of this storage is valid only under KHR_mesh_quantization."""
    if not is_dequantised(name) or component_type == FLOAT:
        return False
    core = _CORE_TEXCOORD if name.startswith("TEXCOORD_") else set()
    return (component_type, normalized) not in core


def dequantised(
    name: str, values: Shaped[np.ndarray, "N K"], accessor: Accessor
) -> tuple[Shaped[np.ndarray, "N K"], Accessor]:
    """Return the values as they are refined and written, with an accessor that describes them.

    Positions, normals, tangents and texture coordinates become float32; all else stays.
    """
    if not is_dequantised(name) or accessor.component_type == FLOAT:
        return values, accessor
    plain = msgspec.structs.replace(accessor, component_type=FLOAT, normalized=False)
    return as_float(values, normalized=accessor.normalized), plain


def as_float(values: Shaped[np.ndarray, "N K"], *, normalized: bool) -> Shaped[np.ndarray, "N K"]:
    """Return integers as float32; normalized: fractions c / max, not below −1 (glTF §3.6.2.2)."""
    if not normalized:
        return values.astype(np.float32)
    fractions = values.astype(np.float64) / np.iinfo(values.dtype).max
    return np.maximum(fractions, -1.0).astype(np.float32)


def still_needed(tree: dict[str, Any]) -> bool:
    """Return whether any primitive of a document, its morph targets too, is quantised."""
    accessors = tree.get("accessors", [])
    return any(
        needs_extension(
            name,
            accessors[index]["componentType"],
            normalized=accessors[index].get("normalized", False),
        )
        for mesh in tree.get("meshes", [])
        for primitive in mesh.get("primitives", [])
        for attributes in (primitive["attributes"], *primitive.get("targets", []))
        for name, index in attributes.items()
    )
