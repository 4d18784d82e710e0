"""Triangles as a GLB: one node, one mesh, a primitive for each material."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pns_common.rows import extent

from ..gltf.constants import (
    ARRAY_BUFFER,
    COMPONENT_TYPES,
    ELEMENT_ARRAY_BUFFER,
    NGONS,
    UNSIGNED_INT,
)
from ..gltf.read.container import read_glb, write_glb
from ..gltf.read.json_text import decode_object, encode
from ..gltf.write.writer import in_words
from ..options import Limits
from .mesh_file import COLOUR, NONE, NORMAL, UV, MeshFile
from .parts import Part, parts_of

_TYPE_OF = {dtype: number for number, dtype in COMPONENT_TYPES.items() if number != UNSIGNED_INT}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


def triangles_glb(
    mesh: MeshFile,
    *,
    material: dict[str, Any] | None = None,
    extras: dict[str, Any] | None = None,
) -> bytes:
    """Write a mesh of one material; `extras` goes to `asset.extras`."""
    parts, _ = parts_of(mesh)
    materials = [] if material is None else [material]
    return parts_glb(
        [replace(part, material=len(materials) - 1) for part in parts], materials, [], extras
    )


def parts_glb(
    parts: Sequence[Part],
    materials: Sequence[dict[str, Any]],
    images: Sequence[str],
    extras: dict[str, Any] | None = None,
    *,
    ngons: bool = False,
) -> bytes:
    """Write parts, whose materials are numbers of `materials`; `images` are URIs.

    `ngons` marks them with FB_ngon_encoding.
    """
    asset: dict[str, Any] = {"version": "2.0", "generator": "pns"}
    if extras:
        asset["extras"] = extras
    tree: dict[str, Any] = {
        "asset": asset,
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": []}],
        "accessors": [],
        "bufferViews": [],
    }
    pieces: list[bytes] = []
    for part in parts:
        attributes = {
            name: _add(tree, pieces, name, stored(name, values))
            for name, values in part.primitive.attributes.items()
        }
        corners = part.primitive.corners.reshape(-1, 1).astype(np.uint32)
        primitive = {
            "attributes": {attribute_name(name): index for name, index in attributes.items()},
            "indices": _add(tree, pieces, "", corners),
        }
        if part.material != NONE:
            primitive["material"] = part.material
        if ngons:
            primitive["extensions"] = {NGONS: {}}
        tree["meshes"][0]["primitives"].append(primitive)
    if ngons:
        tree["extensionsUsed"] = [NGONS]
    tree["buffers"] = [{"byteLength": sum(map(len, pieces))}]
    if materials:
        tree["materials"] = list(materials)
    if images:
        tree["images"] = [{"uri": uri} for uri in images]
        tree["textures"] = [{"source": number} for number in range(len(images))]
    return write_glb(encode(tree), pieces, [])


def attribute_name(layer: str) -> str:
    """Return how a glTF calls a layer: its own names are in capitals, behind an underscore."""
    if not layer.startswith("_"):
        return layer
    return "_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in layer[1:]).upper()


def stored(name: str, values: np.ndarray) -> np.ndarray:
    """Return a layer's values as a glTF holds them: floats are single, v counts downwards."""
    if name == UV:
        values = np.column_stack([values[:, 0], 1 - values[:, 1]])
    narrow = values.dtype.newbyteorder("<") in _TYPE_OF
    if name in ("POSITION", NORMAL, UV) or not narrow:
        return values.astype(np.float32)
    return values


def _add(tree: dict[str, Any], pieces: list[bytes], name: str, values: np.ndarray) -> int:
    """Append an array; return the number of its accessor."""
    indices = name == ""
    content = values if indices else in_words(values, "")
    data = content.tobytes()
    view = {
        "buffer": 0,
        "byteOffset": sum(map(len, pieces)),
        "byteLength": len(data),
        "target": ELEMENT_ARRAY_BUFFER if indices else ARRAY_BUFFER,
    }
    accessor = {
        "bufferView": len(tree["bufferViews"]),
        "componentType": UNSIGNED_INT if indices else _TYPE_OF[values.dtype.newbyteorder("<")],
        "count": len(values),
        "type": _SHAPES[values.shape[1]],
    }
    if not indices and content.shape[1] != values.shape[1] * values.itemsize:
        view["byteStride"] = content.shape[1]
    if name == COLOUR and values.dtype.kind in "ui":
        accessor["normalized"] = True
    if name == "POSITION":
        low, high = extent(values)
        accessor |= {"min": low.tolist(), "max": high.tolist()}
    pieces.append(data)
    tree["bufferViews"].append(view)
    tree["accessors"].append(accessor)
    return len(tree["accessors"]) - 1


def as_gltf_json(glb: bytes, limits: Limits) -> bytes:
    """Return the same file as a .gltf whose buffer is embedded as a data: URI."""
    container = read_glb(glb)
    tree = decode_object(container.text, limits)
    if container.binary is not None:
        length = tree["buffers"][0]["byteLength"]
        content = base64.b64encode(container.binary[:length]).decode()
        tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{content}"
    return encode(tree)
