"""Every index in a document points at something that exists, and every range lies inside its bytes.

Nothing is allocated here, whatever the counts in the file claim.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ....errors import GltfError
from ...constants import COMPONENT_TYPES, UNSIGNED_INTEGERS
from ..accessors import element_size, extent
from ..json_text import escaped
from ..schema import Accessor, Document, Material, Primitive, TextureInfo


def check_references(document: Document, buffers: Sequence[memoryview]) -> None:
    """Check all references but those of the node tree.

    Raises:
        GltfError: with the JSON pointer of the first reference or range that does not hold.
    """
    _check_buffer_views(document, buffers)
    for number, accessor in enumerate(document.accessors):
        _check_accessor(document, accessor, f"/accessors/{number}")
    for number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            _check_primitive(document, primitive, f"/meshes/{number}/primitives/{place}")
    for number, material in enumerate(document.materials):
        for name, texture in _texture_infos(material):
            refer(texture.index, document.textures, f"/materials/{number}/{name}/index")
    for number, texture in enumerate(document.textures):
        refer(texture.source, document.images, f"/textures/{number}/source")
        refer(texture.sampler, document.samplers, f"/textures/{number}/sampler")
    for number, image in enumerate(document.images):
        refer(image.buffer_view, document.buffer_views, f"/images/{number}/bufferView")
    for number, skin in enumerate(document.skins):
        pointer = f"/skins/{number}"
        refer(skin.inverse_bind_matrices, document.accessors, f"{pointer}/inverseBindMatrices")
        refer(skin.skeleton, document.nodes, f"{pointer}/skeleton")
        for place, joint in enumerate(skin.joints):
            refer(joint, document.nodes, f"{pointer}/joints/{place}")
    _check_animations(document)


def refer(index: int | None, targets: Sequence[Any], pointer: str) -> None:
    """Raise GltfError unless `index` is absent or one of the targets'."""
    if index is not None and index >= len(targets):
        raise GltfError(f"index {index}, but there are {len(targets)}", pointer=pointer)


def _check_buffer_views(document: Document, buffers: Sequence[memoryview]) -> None:
    for number, view in enumerate(document.buffer_views):
        pointer = f"/bufferViews/{number}"
        refer(view.buffer, buffers, f"{pointer}/buffer")
        end, available = view.byte_offset + view.byte_length, len(buffers[view.buffer])
        if end > available:
            raise GltfError(f"the view ends at byte {end} of {available}", pointer=pointer)


def _check_accessor(document: Document, accessor: Accessor, pointer: str) -> None:
    refer(accessor.buffer_view, document.buffer_views, f"{pointer}/bufferView")
    if accessor.buffer_view is not None:
        view = document.buffer_views[accessor.buffer_view]
        if view.byte_stride and view.byte_stride < element_size(accessor):
            raise GltfError(
                f"elements of {element_size(accessor)} bytes at a stride of {view.byte_stride}",
                pointer=pointer,
            )
        _check_end(extent(accessor, view), view.byte_length, pointer)
    if accessor.sparse is not None:
        _check_sparse(document, accessor, f"{pointer}/sparse")


def _check_sparse(document: Document, accessor: Accessor, pointer: str) -> None:
    sparse = accessor.sparse
    if sparse is None:
        return
    if sparse.count > accessor.count:
        raise GltfError(
            f"{sparse.count} replacements of {accessor.count} elements", pointer=f"{pointer}/count"
        )
    for name, part, size in (
        ("indices", sparse.indices, COMPONENT_TYPES[sparse.indices.component_type].itemsize),
        ("values", sparse.values, element_size(accessor)),
    ):
        refer(part.buffer_view, document.buffer_views, f"{pointer}/{name}/bufferView")
        available = document.buffer_views[part.buffer_view].byte_length
        _check_end(part.byte_offset + sparse.count * size, available, f"{pointer}/{name}")


def _check_end(end: int, available: int, pointer: str) -> None:
    if end > available:
        raise GltfError(
            f"the elements end at byte {end} of a buffer view of {available}", pointer=pointer
        )


def _check_primitive(document: Document, primitive: Primitive, pointer: str) -> None:
    refer(primitive.material, document.materials, f"{pointer}/material")
    refer(primitive.indices, document.accessors, f"{pointer}/indices")
    if primitive.indices is not None:
        indices = document.accessors[primitive.indices]
        if indices.type != "SCALAR" or indices.component_type not in UNSIGNED_INTEGERS:
            raise GltfError("indices must be unsigned scalars", pointer=f"{pointer}/indices")
    for place, attributes in [("attributes", primitive.attributes)] + [
        (f"targets/{number}", target) for number, target in enumerate(primitive.targets)
    ]:
        for name, index in attributes.items():
            refer(index, document.accessors, f"{pointer}/{place}/{escaped(name)}")
    counts = {
        document.accessors[index].count
        for attributes in (primitive.attributes, *primitive.targets)
        for index in attributes.values()
    }
    if len(counts) > 1:
        raise GltfError(
            f"the attributes have different counts: {sorted(counts)}",
            pointer=f"{pointer}/attributes",
        )


def _texture_infos(material: Material) -> Iterable[tuple[str, TextureInfo]]:
    metallic = material.pbr_metallic_roughness
    infos = {
        "normalTexture": material.normal_texture,
        "occlusionTexture": material.occlusion_texture,
        "emissiveTexture": material.emissive_texture,
    }
    if metallic is not None:
        infos["pbrMetallicRoughness/baseColorTexture"] = metallic.base_color_texture
        infos["pbrMetallicRoughness/metallicRoughnessTexture"] = metallic.metallic_roughness_texture
    return [(name, info) for name, info in infos.items() if info is not None]


def _check_animations(document: Document) -> None:
    for number, animation in enumerate(document.animations):
        pointer = f"/animations/{number}"
        for place, sampler in enumerate(animation.samplers):
            refer(sampler.input, document.accessors, f"{pointer}/samplers/{place}/input")
            refer(sampler.output, document.accessors, f"{pointer}/samplers/{place}/output")
        for place, channel in enumerate(animation.channels):
            target = f"{pointer}/channels/{place}"
            refer(channel.sampler, animation.samplers, f"{target}/sampler")
            refer(channel.target.node, document.nodes, f"{target}/target/node")
