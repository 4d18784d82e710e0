"""Well-formed files to break: small ones of every kind, and the shared assets where they are."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass

import DracoPy
import meshopt
import numpy as np

from service.bodies.media import GLB, GLTF, MEDIA_TYPES
from service.meshfiles.formats import write
from service.meshfiles.glb import as_gltf_json
from service.meshfiles.mesh_file import of_triangles
from service.options import Limits
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron

# Larger files say nothing that smaller ones do not, and take the time of a hundred of them.
LARGEST = 64 * 1024


@dataclass(frozen=True)
class Seed:
    """A body with its content type."""

    name: str
    content_type: str
    body: bytes


def seeds(folder):
    """Everything that a run starts from."""
    all_seeds = made()
    for path in sorted(folder.rglob("*.gl*")) if folder is not None else []:
        if path.stat().st_size <= LARGEST:
            kind = GLB if path.suffix == ".glb" else GLTF
            all_seeds.append(Seed(path.name, kind, path.read_bytes()))
    return all_seeds


def made():
    """Small files for each thing that the reader looks at."""
    all_seeds = []
    for make in (plain, sparse, quantised, strip, compressed_views, draco, skinned):
        tree, binary = make()
        glb = files.pack(tree, bytes(binary))
        all_seeds.append(Seed(make.__name__, GLB, glb))
        all_seeds.append(Seed(f"{make.__name__}.gltf", GLTF, as_gltf_json(glb, Limits())))
    return [*all_seeds, *mesh_files(), *of_two_files(*plain())]


STL = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"


def mesh_files():
    """Boxes in the other formats, text and binary, with what these have beside triangles."""
    solid = of_triangles(box()["POSITION"], box()["indices"])
    points = "".join(f"{x} {y} {z}\n" for x, y, z in solid.vertices)
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in solid.faces)
    obj = "".join(f"v {line}\n" for line in points.splitlines())
    obj += "".join(f"vt {n / 24} 0.5\n" for n in range(24)) + "usemtl a\n"
    obj += "".join("f " + " ".join(f"{v + 1}/{v + 1}" for v in f) + "\n" for f in solid.faces)
    stl = "".join(
        STL.format("".join(f"vertex {x} {y} {z}\n" for x, y, z in corners))
        for corners in solid.vertices[solid.faces].tolist()
    )
    head, _, _ = write(solid, "ply").partition(b"end_header\n")
    text = head.replace(b"binary_little_endian", b"ascii") + b"end_header\n"
    bodies = [
        ("obj", f"# box\no part\n{obj}f -4 -3 -2 -1\n".encode()),
        ("off", f"OFF\n24 12 0\n{points}{faces}\n".encode()),
        ("ply", text + (points + faces).encode()),
        ("stl", f"solid part\n{stl}endsolid part\n".encode()),
        *((kind, write(solid, kind)) for kind in ("ply", "stl", "3mf")),
    ]
    return [Seed(f"{kind} {n}", MEDIA_TYPES[kind], body) for n, (kind, body) in enumerate(bodies)]


def of_two_files(tree, binary):
    """A document and its buffer, as an archive and as two parts."""
    tree = json.loads(json.dumps(tree))
    tree["buffers"][0]["uri"] = "box.bin"
    text, binary = json.dumps(tree).encode(), bytes(binary)
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr("a/box.gltf", text)
        opened.writestr("a/box.bin", binary)
    body = b"".join(
        b'--X\r\nContent-Disposition: form-data; name="%b"\r\n\r\n%b\r\n' % part
        for part in ((b"file", text), (b"box.bin", binary))
    )
    yield Seed("zip", "application/zip", target.getvalue())
    yield Seed("multipart", "multipart/form-data; boundary=X", body + b"--X--\r\n")


def plain():
    """Every kind of thing beside geometry that the reader looks at."""
    tree, binary = files.document([box(), octahedron()], [{"POSITION": np.eye(3), "mode": 1}])
    tree["nodes"] += [{"children": [0, 1]}, {"mesh": 0, "extras": [1, "two", None]}]
    tree["scenes"] = [{"nodes": [2, 3]}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["textures"], tree["samplers"] = [{"source": 0, "sampler": 0}], [{}]
    tree["images"] = [{"bufferView": 0, "mimeType": "image/png"}]
    channel = {"sampler": 0, "target": {"node": 0, "path": "scale"}}
    tree["animations"] = [{"channels": [channel], "samplers": [{"input": 0, "output": 1}]}]
    return tree, binary


def sparse():
    """Positions with replacements, and an accessor without bytes of its own."""
    tree, binary = files.document([octahedron(_VALUE=np.zeros((6, 2)))])
    rows = files.add_accessor(tree, binary, np.array([[1], [4]], dtype=np.uint8))
    values = files.add_accessor(tree, binary, np.ones((2, 3)))
    places, replaced = (tree["accessors"][index]["bufferView"] for index in (rows, values))
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    indices = {"bufferView": places, "componentType": 5121}
    stored = {"count": 2, "indices": indices, "values": {"bufferView": replaced}}
    tree["accessors"][attributes["POSITION"]]["sparse"] = stored
    del tree["accessors"][attributes["_VALUE"]]["bufferView"]
    tree["buffers"] = [{"byteLength": len(binary)}]
    return tree, binary


def quantised():
    """Positions as 16-bit integers, normals as 8-bit fractions."""
    points = octahedron()["POSITION"]
    normals = files.Normalized((127 * points).astype(np.int8))
    whole = (1000 * points).astype(np.int16)
    tree, binary = files.document([octahedron(POSITION=whole, NORMAL=normals)])
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    return tree, binary


def strip():
    """A strip, and a fan without indices."""
    points = np.random.default_rng(0).random((8, 3))
    indices = np.array([0, 1, 2, 3, 3, 4, 5, 6])
    strip = {"POSITION": points, "indices": indices, "mode": 5}
    return files.document([strip, {"POSITION": points, "mode": 6}])


def packed(parts):
    """Bytes one after another at whole words, and where each lies."""
    data, places = bytearray(), []
    for part in parts:
        places.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
        data += part + b"\0" * (-len(part) % 4)
    return data, places


def compressed_views():
    """A box whose every view is compressed by meshopt."""
    tree, binary = files.document([box()])
    parts, extensions = [], []
    for accessor, view in zip(tree["accessors"], tree["bufferViews"], strict=True):
        stride = view["byteLength"] // accessor["count"]
        rows = np.frombuffer(binary, np.uint8, view["byteLength"], view["byteOffset"])
        mode = "TRIANGLES" if accessor["type"] == "SCALAR" else "ATTRIBUTES"
        rows = rows.view(np.uint16) if mode == "TRIANGLES" else rows.reshape(-1, stride)
        parts.append(meshopt.encode_gltf_buffer(rows, mode))
        extensions.append({"byteStride": stride, "count": accessor["count"], "mode": mode})
        view["buffer"] = 1
    data, places = packed(parts)
    for view, extension, place in zip(tree["bufferViews"], extensions, places, strict=True):
        view["extensions"] = {"EXT_meshopt_compression": place | extension}
    tree["buffers"] = [{"byteLength": len(data)}, {"byteLength": len(binary)}]
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["EXT_meshopt_compression"]
    return tree, data


def draco():
    """A box whose one primitive is compressed by Draco, by edgebreaker; its twin sequentially."""
    shape = {name: box()[name] for name in ("POSITION", "NORMAL", "indices")}
    tree, _ = files.document([shape], [shape])
    encoded = [
        DracoPy.encode(
            shape["POSITION"],
            shape["indices"].astype(np.uint32),
            quantization_bits=12,
            preserve_order=in_order,
            normals=shape["NORMAL"],
        )
        for in_order in (False, True)
    ]
    data, tree["bufferViews"] = packed(encoded)
    for number, (mesh, part) in enumerate(zip(tree["meshes"], encoded, strict=True)):
        ids = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(part).attributes}
        stored = {"bufferView": number, "attributes": {"POSITION": ids[0], "NORMAL": ids[1]}}
        mesh["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": stored}
    for accessor in tree["accessors"]:
        del accessor["bufferView"]
    tree["buffers"] = [{"byteLength": len(data)}]
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return tree, data


def skinned():
    """A skin of two joints, and a morph target."""
    shape = octahedron(
        JOINTS_0=np.tile(np.array([[0, 1, 0, 0]], np.uint8), (6, 1)),
        WEIGHTS_0=np.tile([[0.25, 0.75, 0, 0]], (6, 1)),
        targets=[{"POSITION": np.ones((6, 3))}],
    )
    tree, binary = files.document([shape])
    tree["skins"] = [{"joints": [1, 2]}]
    tree["nodes"] = [{"mesh": 0, "skin": 0}, {"children": [2]}, {}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    return tree, binary
