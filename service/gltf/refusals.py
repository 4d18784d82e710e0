"""What a correct glTF may hold and cannot be refined yet: refused by name, so nothing is lost."""

from __future__ import annotations

import re

from service.errors import GltfError, UnsupportedFeature
from service.gltf.accessors import FLOAT, is_padded
from service.gltf.schema import Accessor, Document, Primitive

POINTS_TO_LINES = (0, 1, 2, 3)
TRIANGLES, STRIP, FAN = 4, 5, 6

_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_DRACO = "KHR_draco_mesh_compression"
# Extensions of primitives that name vertices by number: refined vertices have other numbers.
_BY_VERTEX = ("CESIUM_primitive_outline",)
_SKINNING = re.compile(r"(JOINTS|WEIGHTS)_\d+")
_GEOMETRY = {"POSITION": "VEC3", "NORMAL": "VEC3", "TANGENT": "VEC4"}


def refuse_compression(document: Document) -> None:
    """Refuse what must be decoded before its references mean anything.

    Raises:
        UnsupportedFeature: another version of glTF, Draco or meshopt.
    """
    if document.asset.version.partition(".")[0] != "2":
        raise UnsupportedFeature(
            f"glTF version {document.asset.version[:16]}", pointer="/asset/version"
        )
    for number, view in enumerate(document.buffer_views):
        for name in _MESHOPT:
            if name in view.extensions:
                raise UnsupportedFeature(name, pointer=f"/bufferViews/{number}/extensions/{name}")
    for number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            if _DRACO in primitive.extensions:
                pointer = f"/meshes/{number}/primitives/{place}/extensions/{_DRACO}"
                raise UnsupportedFeature(_DRACO, pointer=pointer)


def refuse_features(document: Document) -> None:
    """Refuse primitives of surfaces that would come back incomplete; references are checked.

    Raises:
        UnsupportedFeature: skins, morph targets, strips, fans, sparse or quantised attributes.
        GltfError: an attribute of a type that glTF does not allow.
    """
    for number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            if primitive.mode not in POINTS_TO_LINES:
                _refuse_primitive(document, primitive, f"/meshes/{number}/primitives/{place}")
    for number, node in enumerate(document.nodes):
        if node.skin is not None and node.mesh is not None:
            primitives = document.meshes[node.mesh].primitives
            if any(primitive.mode == TRIANGLES for primitive in primitives):
                raise UnsupportedFeature("a skinned mesh", pointer=f"/nodes/{number}/skin")


def _refuse_primitive(document: Document, primitive: Primitive, pointer: str) -> None:
    if primitive.mode != TRIANGLES:
        name = {STRIP: "a triangle strip", FAN: "a triangle fan"}[primitive.mode]
        raise UnsupportedFeature(name, pointer=f"{pointer}/mode")
    if primitive.targets:
        raise UnsupportedFeature("a mesh with morph targets", pointer=f"{pointer}/targets")
    for name in _BY_VERTEX:
        if name in primitive.extensions:
            raise UnsupportedFeature(name, pointer=f"{pointer}/extensions/{name}")
    if "POSITION" not in primitive.attributes:
        raise UnsupportedFeature("a primitive without POSITION", pointer=f"{pointer}/attributes")
    if primitive.indices is not None:
        _refuse_storage(document.accessors[primitive.indices], primitive.indices)
    for name, index in primitive.attributes.items():
        accessor = document.accessors[index]
        if _SKINNING.fullmatch(name):
            raise UnsupportedFeature("a skinned mesh", pointer=f"{pointer}/attributes/{name}")
        _refuse_storage(accessor, index)
        _refuse_type(name, accessor, f"/accessors/{index}")


def _refuse_storage(accessor: Accessor, index: int) -> None:
    if accessor.sparse is not None:
        raise UnsupportedFeature("a sparse accessor", pointer=f"/accessors/{index}/sparse")
    if accessor.buffer_view is None:
        raise UnsupportedFeature("an accessor without a buffer view", pointer=f"/accessors/{index}")
    if is_padded(accessor):
        raise UnsupportedFeature("a matrix of padded columns", pointer=f"/accessors/{index}")


def _refuse_type(name: str, accessor: Accessor, pointer: str) -> None:
    if name in _GEOMETRY:
        if accessor.type != _GEOMETRY[name]:
            raise GltfError(f"{name} must be {_GEOMETRY[name]}", pointer=f"{pointer}/type")
        if accessor.component_type != FLOAT:
            raise UnsupportedFeature(
                f"KHR_mesh_quantization of {name}", pointer=f"{pointer}/componentType"
            )
    elif accessor.component_type != FLOAT and not accessor.normalized:
        if name.startswith("TEXCOORD_"):
            raise UnsupportedFeature(
                f"KHR_mesh_quantization of {name}", pointer=f"{pointer}/componentType"
            )
        if name.startswith("COLOR_"):
            raise GltfError(f"integers in {name} must be normalized", pointer=pointer)
