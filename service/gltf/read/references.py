"""Check references: each index names an element, each range lies in its bytes, nodes form trees.

Nothing is allocated in proportion to the counts in the file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from ...changes import Change
from ...errors import GltfError
from ..constants import COMPONENT_TYPES, OUTLINE, UNSIGNED_INTEGERS
from .accessors import element_size
from .container import escaped
from .schema import Accessor, Document, Material, Primitive, Sparse, TextureInfo


def check_references(document: Document, buffers: Sequence[memoryview]) -> None:
    """Check all references except those of nodes and scenes.

    Raises:
        GltfError: with the JSON pointer of the first reference or range that does not hold.
    """
    _check_buffer_views(document, buffers)
    _check_accessors(document)
    for number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            _check_primitive(document, primitive, f"/meshes/{number}/primitives/{place}")
    for number, material in enumerate(document.materials):
        for name, texture in _texture_infos(material):
            refer(texture.index, document.textures, f"/materials/{number}/{name}/index")
    textures = document.textures
    refer_each([each.source for each in textures], document.images, "/textures", "/source")
    refer_each([each.sampler for each in textures], document.samplers, "/textures", "/sampler")
    views = [image.buffer_view for image in document.images]
    refer_each(views, document.buffer_views, "/images", "/bufferView")
    for number, skin in enumerate(document.skins):
        pointer = f"/skins/{number}"
        refer(skin.inverse_bind_matrices, document.accessors, f"{pointer}/inverseBindMatrices")
        refer(skin.skeleton, document.nodes, f"{pointer}/skeleton")
        refer_each(skin.joints, document.nodes, f"{pointer}/joints")
    _check_animations(document)


def refer(index: int | None, targets: Sequence[Any], pointer: str) -> None:
    """Raise GltfError if an index is given and no target has it."""
    if index is not None and index >= len(targets):
        raise GltfError(f"index {index}, but there are {len(targets)}", pointer=pointer)


def refer_each(
    indices: Sequence[int | None], targets: Sequence[Any], pointer: str, name: str = ""
) -> None:
    """Raise GltfError for the first index without a target, at `pointer`/number/`name`."""
    count = len(targets)
    for place, index in enumerate(indices):
        if index is not None and index >= count:
            refer(index, targets, f"{pointer}/{place}{name}")


def _check_buffer_views(document: Document, buffers: Sequence[memoryview]) -> None:
    views = document.buffer_views
    refer_each([view.buffer for view in views], buffers, "/bufferViews", "/buffer")
    lengths = [len(buffer) for buffer in buffers]
    for number, view in enumerate(views):
        end, available = view.byte_offset + view.byte_length, lengths[view.buffer]
        if end > available:
            raise GltfError(
                f"the view ends at byte {end} of {available}", pointer=f"/bufferViews/{number}"
            )


def _check_accessors(document: Document) -> None:
    accessors, views = document.accessors, document.buffer_views
    refer_each([each.buffer_view for each in accessors], views, "/accessors", "/bufferView")
    for number, accessor in enumerate(accessors):
        if accessor.buffer_view is not None:
            view, size = views[accessor.buffer_view], element_size(accessor)
            stride = view.byte_stride or size
            if stride < size:
                raise GltfError(
                    f"elements of {size} bytes at a stride of {stride}",
                    pointer=f"/accessors/{number}",
                )
            end = accessor.byte_offset + stride * (accessor.count - 1) + size
            _check_end(end, view.byte_length, f"/accessors/{number}")
        if accessor.sparse is not None:
            _check_sparse(document, accessor, accessor.sparse, f"/accessors/{number}/sparse")


def _check_sparse(document: Document, accessor: Accessor, sparse: Sparse, pointer: str) -> None:
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
    if OUTLINE in primitive.extensions:
        _check_outline(document, primitive, f"{pointer}/extensions/{OUTLINE}")
    for place, attributes in [("attributes", primitive.attributes)] + [
        (f"targets/{number}", target) for number, target in enumerate(primitive.targets)
    ]:
        for name, index in attributes.items():
            refer(index, document.accessors, f"{pointer}/{place}/{escaped(name)}")
    counts = {document.accessors[index].count for _, index in primitive.named}
    if len(counts) > 1:
        raise GltfError(
            f"the attributes have different counts: {sorted(counts)}",
            pointer=f"{pointer}/attributes",
        )


def _check_outline(document: Document, primitive: Primitive, pointer: str) -> None:
    if primitive.outline is None:
        raise GltfError("an outline names an accessor as its indices", pointer=pointer)
    refer(primitive.outline, document.accessors, f"{pointer}/indices")
    stored = document.accessors[primitive.outline]
    fits = stored.type == "SCALAR" and stored.component_type in UNSIGNED_INTEGERS
    # Without bytes a count would cost nothing.
    if not fits or stored.count % 2 or stored.buffer_view is None or stored.sparse is not None:
        raise GltfError("an outline has pairs of unsigned scalars", pointer=f"{pointer}/indices")


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
        samplers, pointer = animation.samplers, f"/animations/{number}/samplers"
        refer_each([each.input for each in samplers], document.accessors, pointer, "/input")
        refer_each([each.output for each in samplers], document.accessors, pointer, "/output")
        channels, pointer = animation.channels, f"/animations/{number}/channels"
        refer_each([each.sampler for each in channels], samplers, pointer, "/sampler")
        nodes = [each.target.node for each in channels]
        refer_each(nodes, document.nodes, pointer, "/target/node")


def check_nodes(document: Document) -> list[Change]:
    """Check the references of nodes and scenes, and that no node is its own ancestor.

    Returns nodes with several parents. They break glTF 2.0 §3.5.2 without consequence here.

    Raises:
        GltfError: with the JSON pointer of the reference that does not hold.
    """
    parents: Counter[int] = Counter()
    several: list[str] = []
    for number, node in enumerate(document.nodes):
        pointer = f"/nodes/{number}"
        refer(node.mesh, document.meshes, f"{pointer}/mesh")
        refer(node.skin, document.skins, f"{pointer}/skin")
        refer(node.camera, document.cameras, f"{pointer}/camera")
        for place, child in enumerate(node.children):
            refer(child, document.nodes, f"{pointer}/children/{place}")
            parents[child] += 1
            if parents[child] > 1:
                several.append(f"{pointer}/children/{place}")
    _check_acyclic(document, parents)
    refer(document.scene, document.scenes, "/scene")
    for number, scene in enumerate(document.scenes):
        for place, root in enumerate(scene.nodes):
            # Some exporters list children as roots too; their parents place them.
            refer(root, document.nodes, f"/scenes/{number}/nodes/{place}")
    if not several:
        return []
    return [Change(several[0], "breach", len(several), ("nodes with more than one parent",))]


def mesh_instances(document: Document) -> list[int]:
    """Return for each mesh the number of nodes that show it."""
    counts = [0] * len(document.meshes)
    for node in document.nodes:
        if node.mesh is not None:
            counts[node.mesh] += 1
    return counts


def _check_acyclic(document: Document, parents: Counter[int]) -> None:
    """Remove nodes without parents until none is left (Kahn 1962); the rest lie on cycles."""
    left = [parents[number] for number in range(len(document.nodes))]
    free = [number for number, count in enumerate(left) if count == 0]
    taken = 0
    while free:
        taken += 1
        for child in document.nodes[free.pop()].children:
            left[child] -= 1
            if left[child] == 0:
                free.append(child)
    if taken < len(left):
        node = _on_a_cycle(document, left)
        raise GltfError(f"node {node} is its own ancestor", pointer=f"/nodes/{node}")


def _on_a_cycle(document: Document, left: list[int]) -> int:
    """Return the first node that a walk from child to parent meets twice."""
    parent = {
        child: number
        for number, node in enumerate(document.nodes)
        if left[number]
        for child in node.children
    }
    node, seen = next(number for number, count in enumerate(left) if count), set[int]()
    while node not in seen:
        seen.add(node)
        node = parent[node]
    return node
