"""Plain triangles as a GLB: one mesh, one primitive, one node."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from pns_common.rows import extent

from ..gltf.constants import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, FLOAT, UNSIGNED_INT
from ..gltf.read.container import read_glb, write_glb
from ..gltf.read.json_text import decode_object, encode
from ..options import Limits
from .indexed_triangles import IndexedTriangles


def triangles_glb(
    triangles: IndexedTriangles,
    *,
    material: dict[str, Any] | None = None,
    normals: np.ndarray | None = None,
    extras: dict[str, Any] | None = None,
) -> bytes:
    """Write the file's bytes; `extras` goes to `asset.extras`."""
    asset: dict[str, Any] = {"version": "2.0", "generator": "pns"}
    if extras:
        asset["extras"] = extras
    pieces = [("POSITION", triangles.vertices)]
    if normals is not None:
        pieces.append(("NORMAL", normals))
    if triangles.uv is not None:
        # glTF counts v downwards.
        pieces.append(("TEXCOORD_0", np.column_stack([triangles.uv[:, 0], 1 - triangles.uv[:, 1]])))
    arrays: list[np.ndarray] = [np.ascontiguousarray(v, dtype=np.float32) for _, v in pieces]
    arrays.append(triangles.faces.reshape(-1).astype(np.uint32))

    primitive: dict[str, Any] = {
        "attributes": {name: number for number, (name, _) in enumerate(pieces)},
        "indices": len(pieces),
    }
    tree: dict[str, Any] = {
        "asset": asset,
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [_accessor(number, values) for number, values in enumerate(arrays)],
        "bufferViews": _views(arrays),
        "buffers": [{"byteLength": sum(values.nbytes for values in arrays)}],
    }
    low, high = extent(arrays[0])
    tree["accessors"][0] |= {"min": low.tolist(), "max": high.tolist()}
    if material is not None:
        primitive["material"] = 0
        tree["materials"] = [material]
    return write_glb(encode(tree), [values.tobytes() for values in arrays], [])


def as_gltf_json(glb: bytes, limits: Limits) -> bytes:
    """Return the same file as a .gltf whose buffer is embedded as a data: URI."""
    container = read_glb(glb)
    tree = decode_object(container.text, limits)
    if container.binary is not None:
        length = tree["buffers"][0]["byteLength"]
        content = base64.b64encode(container.binary[:length]).decode()
        tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{content}"
    return encode(tree)


def _accessor(number: int, values: np.ndarray) -> dict[str, Any]:
    if values.ndim == 1:
        shape, component = "SCALAR", UNSIGNED_INT
    else:
        shape, component = f"VEC{values.shape[1]}", FLOAT
    return {
        "bufferView": number,
        "componentType": component,
        "count": len(values),
        "type": shape,
    }


def _views(arrays: list[np.ndarray]) -> list[dict[str, int]]:
    views: list[dict[str, int]] = []
    offset = 0
    for values in arrays:
        target = ELEMENT_ARRAY_BUFFER if values.ndim == 1 else ARRAY_BUFFER
        views.append(
            {"buffer": 0, "byteOffset": offset, "byteLength": values.nbytes, "target": target}
        )
        offset += values.nbytes
    return views
