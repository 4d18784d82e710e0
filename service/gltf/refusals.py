"""What a correct glTF may hold and cannot be refined yet: refused by name, so nothing is lost."""

from __future__ import annotations

import re

from service.errors import GltfError, UnsupportedFeature
from service.gltf.accessors import FLOAT
from service.gltf.modes import SURFACES
from service.gltf.quantization import allowed, is_dequantised
from service.gltf.schema import Accessor, Document, Primitive

# Extensions of primitives that name vertices by number: refined vertices have other numbers.
_BY_VERTEX = ("CESIUM_primitive_outline",)
_SKINNING = re.compile(r"(JOINTS|WEIGHTS)_\d+")
_GEOMETRY = {"POSITION": "VEC3", "NORMAL": "VEC3", "TANGENT": "VEC4"}


def refuse_version(document: Document) -> None:
    """Refuse another version of glTF.

    Raises:
        UnsupportedFeature: another version of glTF.
    """
    if document.asset.version.partition(".")[0] != "2":
        raise UnsupportedFeature(
            f"glTF version {document.asset.version[:16]}", pointer="/asset/version"
        )


def refuse_features(document: Document) -> None:
    """Refuse primitives of surfaces that would come back incomplete; references are checked.

    Raises:
        UnsupportedFeature: skins, morph targets.
        GltfError: an attribute of a type that glTF does not allow.
    """
    for number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            if primitive.mode in SURFACES:
                _refuse_primitive(document, primitive, f"/meshes/{number}/primitives/{place}")
    for number, node in enumerate(document.nodes):
        if node.skin is not None and node.mesh is not None:
            primitives = document.meshes[node.mesh].primitives
            if any(primitive.mode in SURFACES for primitive in primitives):
                raise UnsupportedFeature("a skinned mesh", pointer=f"/nodes/{number}/skin")


def _refuse_primitive(document: Document, primitive: Primitive, pointer: str) -> None:
    if primitive.targets:
        raise UnsupportedFeature("a mesh with morph targets", pointer=f"{pointer}/targets")
    for name in _BY_VERTEX:
        if name in primitive.extensions:
            raise UnsupportedFeature(name, pointer=f"{pointer}/extensions/{name}")
    if "POSITION" not in primitive.attributes:
        raise UnsupportedFeature("a primitive without POSITION", pointer=f"{pointer}/attributes")
    for name, index in primitive.attributes.items():
        accessor = document.accessors[index]
        if _SKINNING.fullmatch(name):
            raise UnsupportedFeature("a skinned mesh", pointer=f"{pointer}/attributes/{name}")
        _refuse_type(name, accessor, f"/accessors/{index}")


def _refuse_type(name: str, accessor: Accessor, pointer: str) -> None:
    if name in _GEOMETRY and accessor.type != _GEOMETRY[name]:
        raise GltfError(f"{name} must be {_GEOMETRY[name]}", pointer=f"{pointer}/type")
    if name.startswith("TEXCOORD_") and accessor.type != "VEC2":
        raise GltfError(f"{name} must be VEC2", pointer=f"{pointer}/type")
    if accessor.component_type == FLOAT:
        return
    storage = (accessor.component_type, accessor.normalized)
    if is_dequantised(name) and storage not in allowed(name):
        raise GltfError(
            f"{name} may not be stored as integers of this type", pointer=f"{pointer}/componentType"
        )
    if name.startswith("COLOR_") and not accessor.normalized:
        raise GltfError(f"integers in {name} must be normalized", pointer=pointer)
