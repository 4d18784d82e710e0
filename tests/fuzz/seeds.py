"""Well-formed files to break: small ones of every kind, and the shared assets where they are."""

from __future__ import annotations

import base64
import io
import json
import zipfile
from dataclasses import dataclass

import DracoPy
import meshopt
import numpy as np
import trimesh

from service.bodies.media import GLB, GLTF, MEDIA_TYPES
from service.meshfiles.formats import write
from service.meshfiles.mesh_file import of_triangles
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
    trees = {
        "plain": plain(),
        "sparse": sparse(),
        "quantised": quantised(),
        "strip": strip(),
        "meshopt": compressed_views(),
        "draco": draco(),
        "skinned": skinned(),
    }
    gathered = [
        Seed(name, GLB, files.pack(tree, bytes(binary))) for name, (tree, binary) in trees.items()
    ]
    gathered += [Seed(f"{name}.gltf", GLTF, embedded(*trees[name])) for name in trees]
    return [*gathered, *mesh_files(), zipped(*trees["plain"]), multipart(*trees["plain"])]


def mesh_files():
    """Boxes in the other formats, text and binary, with what these have beside triangles."""
    solid = trimesh.creation.box()
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in solid.vertices)
    text += "".join(f"vt {n / 8} 0.5\n" for n in range(8)) + "usemtl a\n"
    text += "".join("f " + " ".join(f"{v + 1}/{v + 1}" for v in f) + "\n" for f in solid.faces)
    bodies = {
        "obj": ("obj", f"# box\no part\n{text}f -4 -3 -2 -1\n".encode()),
        "off": ("off", solid.export(file_type="off").encode() + b"\n"),
        "ply": ("ply", bytes(solid.export(file_type="ply"))),
        "text ply": ("ply", solid.export(file_type="ply", encoding="ascii")),
        "stl": ("stl", bytes(solid.export(file_type="stl"))),
        "text stl": ("stl", solid.export(file_type="stl_ascii").encode()),
        "3mf": ("3mf", write(of_triangles(solid.vertices, solid.faces), "3mf")),
    }
    return [Seed(name, MEDIA_TYPES[kind], body) for name, (kind, body) in bodies.items()]


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
    places, replaced = (tree["accessors"][index] for index in (rows, values))
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    tree["accessors"][attributes["POSITION"]]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": places["bufferView"], "componentType": 5121},
        "values": {"bufferView": replaced["bufferView"]},
    }
    del tree["accessors"][attributes["_VALUE"]]["bufferView"]
    tree["buffers"] = [{"byteLength": len(binary)}]
    return tree, binary


def quantised():
    """Positions as 16-bit integers, normals as 8-bit fractions."""
    shape = octahedron()
    points = shape["POSITION"]
    shape["POSITION"] = (1000 * points).astype(np.int16)
    shape["NORMAL"] = files.Normalized((127 * points).astype(np.int8))
    tree, binary = files.document([shape])
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    return tree, binary


def strip():
    """A strip, and a fan without indices."""
    points = np.random.default_rng(0).random((8, 3))
    return files.document(
        [
            {"POSITION": points, "indices": np.array([0, 1, 2, 3, 3, 4, 5, 6]), "mode": 5},
            {"POSITION": points, "mode": 6},
        ]
    )


def compressed_views():
    """A box whose every view is compressed by meshopt."""
    tree, binary = files.document([box()])
    packed = bytearray()
    for number, view in enumerate(tree["bufferViews"]):
        accessor = tree["accessors"][number]
        stride = view["byteLength"] // accessor["count"]
        rows = np.frombuffer(binary, np.uint8, view["byteLength"], view["byteOffset"])
        attributes = accessor["type"] != "SCALAR"
        if attributes:
            data = meshopt.encode_gltf_buffer(rows.reshape(-1, stride), "ATTRIBUTES")
        else:
            data = meshopt.encode_gltf_buffer(rows.view(np.uint16), "TRIANGLES")
        view["buffer"] = 1
        view["extensions"] = {
            "EXT_meshopt_compression": {
                "buffer": 0,
                "byteOffset": len(packed),
                "byteLength": len(data),
                "byteStride": stride,
                "count": accessor["count"],
                "mode": "ATTRIBUTES" if attributes else "TRIANGLES",
            }
        }
        packed += data + b"\0" * (-len(data) % 4)
    tree["buffers"] = [{"byteLength": len(packed)}, {"byteLength": len(binary)}]
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["EXT_meshopt_compression"]
    return tree, packed


def draco():
    """A box whose one primitive is compressed by Draco, by edgebreaker; its twin sequentially."""
    tree, _ = files.document([box()], [box()])
    packed = bytearray()
    tree["bufferViews"] = []
    for mesh in (0, 1):
        shape = box()
        data = DracoPy.encode(
            shape["POSITION"].astype(np.float64),
            shape["indices"].astype(np.uint32),
            quantization_bits=12,
            preserve_order=mesh == 1,
            normals=shape["NORMAL"].astype(np.float64),
        )
        ids = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(data).attributes}
        primitive = tree["meshes"][mesh]["primitives"][0]
        for name in ("TANGENT", "TEXCOORD_0"):
            del primitive["attributes"][name]
        primitive["extensions"] = {
            "KHR_draco_mesh_compression": {
                "bufferView": mesh,
                "attributes": {"POSITION": ids[0], "NORMAL": ids[1]},
            }
        }
        tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(packed), "byteLength": len(data)}
        )
        packed += data + b"\0" * (-len(data) % 4)
    for accessor in tree["accessors"]:
        del accessor["bufferView"]
    tree["buffers"] = [{"byteLength": len(packed)}]
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return tree, packed


def skinned():
    """A skin of two joints, and a morph target."""
    shape = octahedron(
        JOINTS_0=np.tile(np.array([[0, 1, 0, 0]], np.uint8), (6, 1)),
        WEIGHTS_0=np.tile([[0.25, 0.75, 0, 0]], (6, 1)),
    )
    tree, binary = files.document([shape])
    target = files.add_accessor(tree, binary, np.ones((6, 3)))
    tree["buffers"] = [{"byteLength": len(binary)}]
    tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    tree["skins"] = [{"joints": [1, 2]}]
    tree["nodes"] = [{"mesh": 0, "skin": 0}, {"children": [2]}, {}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    return tree, binary


def embedded(tree, binary):
    """The same as a .gltf of one file."""
    tree = json.loads(json.dumps(tree))
    content = base64.b64encode(bytes(binary)).decode()
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{content}"
    return json.dumps(tree).encode()


def zipped(tree, binary):
    """The same as an archive of two files."""
    tree = json.loads(json.dumps(tree))
    tree["buffers"][0]["uri"] = "box.bin"
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr("a/box.gltf", json.dumps(tree))
        opened.writestr("a/box.bin", bytes(binary))
    return Seed("zip", "application/zip", target.getvalue())


def multipart(tree, binary):
    """The same as two parts."""
    tree = json.loads(json.dumps(tree))
    tree["buffers"][0]["uri"] = "box.bin"
    parts = [("file", json.dumps(tree).encode()), ("box.bin", bytes(binary))]
    body = b"".join(
        b'--X\r\nContent-Disposition: form-data; name="%b"\r\n\r\n%b\r\n' % (name.encode(), data)
        for name, data in parts
    )
    return Seed("multipart", "multipart/form-data; boundary=X", body + b"--X--\r\n")
