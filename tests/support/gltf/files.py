"""glTF files for the tests, written and read by code of their own: struct, json and numpy."""

import json
import struct
from dataclasses import dataclass

import numpy as np

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


@dataclass
class Normalized:
    """Integers that stand for fractions."""

    values: np.ndarray


def document(*meshes):
    """(JSON tree, BIN) of meshes; a mesh is a list of primitives, a primitive a dictionary.

    A primitive has `indices` (or none), perhaps `mode`, perhaps `targets` (dictionaries of deltas),
    and attributes by their glTF names.
    """
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [],
        "bufferViews": [],
        "accessors": [],
        "meshes": [],
        "nodes": [{"mesh": number} for number in range(len(meshes))],
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "scene": 0,
    }
    binary = bytearray()
    for mesh in meshes:
        primitives = []
        for primitive in mesh:
            entry = {"attributes": {}}
            for name, values in primitive.items():
                if name == "mode":
                    entry["mode"] = values
                elif name == "indices":
                    entry["indices"] = add_accessor(tree, binary, np.asarray(values).reshape(-1, 1))
                elif name == "targets":
                    entry["targets"] = [
                        {key: add_accessor(tree, binary, delta) for key, delta in target.items()}
                        for target in values
                    ]
                else:
                    entry["attributes"][name] = add_accessor(tree, binary, values)
            primitives.append(entry)
        tree["meshes"].append({"primitives": primitives})
    if binary:
        tree["buffers"] = [{"byteLength": len(binary)}]
    return tree, binary


def add_accessor(tree, binary, values):
    """Append an accessor over its own buffer view, rows padded to whole words."""
    normalized = isinstance(values, Normalized)
    values = np.asarray(values.values if normalized else values)
    if values.dtype == np.float64:
        values = values.astype(np.float32)
    if values.dtype == np.int64:
        values = values.astype(np.uint32)
    values = np.ascontiguousarray(values)
    width = values.shape[1] * values.itemsize
    scalar_integer = values.shape[1] == 1 and values.dtype.kind == "u"
    stride = width if scalar_integer else width + -width % 4
    binary.extend(b"\0" * (-len(binary) % 4))
    view = {"buffer": 0, "byteOffset": len(binary), "byteLength": stride * len(values)}
    if stride != width:
        view["byteStride"] = stride
    for row in values:
        binary.extend(row.tobytes().ljust(stride, b"\0"))
    tree["bufferViews"].append(view)
    accessor = {
        "bufferView": len(tree["bufferViews"]) - 1,
        "componentType": COMPONENTS[values.dtype.str[1:]],
        "count": len(values),
        "type": TYPES[values.shape[1]],
    }
    if normalized:
        accessor["normalized"] = True
    if values.dtype == np.float32 and values.shape[1] == 3:
        accessor["min"], accessor["max"] = values.min(0).tolist(), values.max(0).tolist()
    tree["accessors"].append(accessor)
    return len(tree["accessors"]) - 1


def pack(tree, binary=b"", others=()):
    """A GLB."""
    text = json.dumps(tree).encode() if isinstance(tree, dict) else tree
    chunks = chunk(b"JSON", text, b" ")
    if binary:
        chunks += chunk(b"BIN\0", bytes(binary), b"\0")
    for kind, data in others:
        chunks += chunk(kind, data, b"\0")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def chunk(kind, data, filler):
    """One chunk, padded."""
    data = data + filler * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data


def glb(*meshes):
    """A GLB of meshes as `document` takes them."""
    return pack(*document(*meshes))


def unpack(data):
    """(JSON tree, BIN) of a GLB."""
    _, _, length = struct.unpack_from("<4sII", data)
    assert length == len(data)
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    tree = json.loads(data[20 : 20 + size])
    rest = data[20 + size :]
    binary = b""
    if rest:
        size, kind = struct.unpack_from("<I4s", rest)
        assert kind == b"BIN\0"
        binary = rest[8 : 8 + size]
    return tree, binary


def values_of(tree, binary, index):
    """The elements of an accessor, (N, K)."""
    accessor = tree["accessors"][index]
    if "sparse" not in accessor:
        return _stored(tree, binary, accessor)
    count, apart = accessor["sparse"]["count"], accessor["sparse"]
    places = _stored(tree, binary, {**apart["indices"], "count": count, "type": "SCALAR"})
    values = _stored(
        tree, binary, accessor | {"byteOffset": 0} | apart["values"] | {"count": count}
    )
    elements = _stored(tree, binary, accessor)
    elements[places[:, 0]] = values
    return elements


def _stored(tree, binary, accessor):
    """The elements as they lie in a view; zeros without one."""
    dtype = np.dtype(
        {number: name for name, number in COMPONENTS.items()}[accessor["componentType"]]
    )
    width = WIDTHS[accessor["type"]]
    if "bufferView" not in accessor:
        return np.zeros((accessor["count"], width), dtype)
    view = tree["bufferViews"][accessor["bufferView"]]
    stride = view.get("byteStride", width * dtype.itemsize)
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    rows = [
        np.frombuffer(binary, dtype, width, start + stride * n) for n in range(accessor["count"])
    ]
    return np.stack(rows)


def primitive_of(data, mesh=0, primitive=0):
    """(faces, attributes by name) of a primitive of a GLB."""
    tree, binary = unpack(data)
    entry = tree["meshes"][mesh]["primitives"][primitive]
    attributes = {n: values_of(tree, binary, i) for n, i in entry["attributes"].items()}
    faces = values_of(tree, binary, entry["indices"]).astype(np.int64).reshape(-1, 3)
    return faces, attributes


def targets_of(data, mesh=0, primitive=0):
    """The morph targets of a primitive of a GLB: deltas by name."""
    tree, binary = unpack(data)
    entry = tree["meshes"][mesh]["primitives"][primitive]
    return [
        {name: values_of(tree, binary, index) for name, index in target.items()}
        for target in entry.get("targets", [])
    ]
