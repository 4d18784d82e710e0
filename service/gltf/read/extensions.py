"""Extensions: the lists of them, unknown ones, and numbers that they and glTF hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ...changes import Change
from ..constants import OUTLINE, SURFACES, TRIANGLES

_LISTS = ("extensionsUsed", "extensionsRequired")
# Extensions of meshes that number vertices, and that a mesh can do without. EXT_mesh_manifold says
# which vertices are one; equal positions still do. EXT_mesh_primitive_restart (formerly
# BENTLEY_primitive_restart) draws several strips as one; they are written as triangles.
BY_NUMBER = ("EXT_mesh_manifold", "EXT_mesh_primitive_restart", "BENTLEY_primitive_restart")
INSTANCING = "EXT_mesh_gpu_instancing"
# Extensions without numbers of accessors and buffer views, or with those that are yielded here.
KNOWN = frozenset({
    INSTANCING, OUTLINE, "EXT_instance_features", "EXT_lights_image_based", "EXT_mesh_features",
    "EXT_meshopt_compression", "EXT_texture_avif", "EXT_texture_webp", "FB_ngon_encoding",
    "GODOT_single_root", "KHR_animation_pointer", "KHR_draco_mesh_compression",
    "KHR_gaussian_splatting", "KHR_implicit_shapes", "KHR_lights_punctual",
    "KHR_materials_anisotropy", "KHR_materials_clearcoat", "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_iridescence", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_sheen",
    "KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_unlit",
    "KHR_materials_variants", "KHR_materials_volume", "KHR_mesh_quantization",
    "KHR_meshopt_compression", "KHR_node_hoverability", "KHR_node_selectability",
    "KHR_node_visibility", "KHR_physics_rigid_bodies", "KHR_texture_basisu",
    "KHR_texture_transform", "KHR_xmp_json_ld", "MSFT_lod", "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic", "MSFT_texture_dds", "VRM",
    "VRMC_materials_hdr_emissiveMultiplier", "VRMC_materials_mtoon", "VRMC_node_constraint",
    "VRMC_springBone", "VRMC_springBone_extended_collider", "VRMC_vrm", "VRMC_vrm_animation",
})  # fmt: skip

# References `holder[key]`, for each of the holders that has this key. All samplers of an animation
# are one such list: an object for each number takes three times as long.
References = tuple[Sequence[dict[str, Any]], str]


def withdraw(tree: dict[str, Any], name: str) -> None:
    """Remove an extension that is no longer used from `extensionsUsed` and `extensionsRequired`."""
    for key in _LISTS:
        if name in tree.get(key, []):
            tree[key] = [other for other in tree[key] if other != name]
            # glTF allows no empty list.
            if not tree[key]:
                del tree[key]


def declare(tree: dict[str, Any], name: str) -> None:
    """Add an extension that readers need to `extensionsUsed` and `extensionsRequired`."""
    for key in _LISTS:
        names = tree.setdefault(key, [])
        if name not in names:
            names.append(name)


def drop(holder: dict[str, Any], name: str) -> None:
    """Remove an extension's object from its holder, and `extensions` if it is then empty."""
    extensions = holder.get("extensions", {})
    extensions.pop(name, None)
    if not extensions:
        holder.pop("extensions", None)


def leave_out_vertex_numbers(tree: dict[str, Any]) -> list[Change]:
    """Remove the extensions BY_NUMBER from meshes that will be refined; return the changes.

    Refined vertices have other numbers; a reader that used the old ones would show another mesh.
    """
    return [change for name in BY_NUMBER for change in _leave_out(tree, name)]


def _leave_out(tree: dict[str, Any], name: str) -> list[Change]:
    changes: list[Change] = []
    stays = False
    for number, mesh in enumerate(tree.get("meshes", [])):
        extensions = mesh.get("extensions")
        if not isinstance(extensions, dict) or name not in extensions:
            continue
        if not any(p.get("mode", TRIANGLES) in SURFACES for p in mesh.get("primitives", [])):
            stays = True
            continue
        drop(mesh, name)
        changes.append(Change(f"/meshes/{number}", "numbers-of-vertices", 1, (name,)))
    if changes and not stays:
        withdraw(tree, name)
    return changes


def unknown_extensions(tree: dict[str, Any], text: bytes) -> list[str]:
    """Return the extensions in use that are not KNOWN: they may hold numbers of accessors or views.

    `text` is the JSON of the tree: a search of it skips the walk for files without extensions.
    """
    names = {name for key in _LISTS for name in tree.get(key, [])}
    # An escape could spell the word.
    pending: list[Any] = [tree] if b'"extensions"' in text or b"\\u" in text else []
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            if isinstance(value.get("extensions"), dict):
                # |= would copy all names for each holder of keys.
                names.update(value["extensions"])
            # Extras belong to applications.
            pending += [part for key, part in value.items() if key != "extras"]
        elif isinstance(value, list):
            pending += value
    return sorted(names - KNOWN)


def accessor_references(tree: dict[str, Any]) -> Iterator[References]:
    """Yield all references to accessors."""
    for mesh in tree.get("meshes", []):
        primitives = mesh.get("primitives", [])
        yield primitives, "indices"
        for primitive in primitives:
            for attributes in (primitive["attributes"], *primitive.get("targets", [])):
                yield from (([attributes], name) for name in attributes)
            if (outline := primitive.get("extensions", {}).get(OUTLINE)) is not None:
                yield [outline], "indices"
    yield tree.get("skins", []), "inverseBindMatrices"
    for animation in tree.get("animations", []):
        yield animation["samplers"], "input"
        yield animation["samplers"], "output"
    for node in tree.get("nodes", []):
        instances = node.get("extensions", {}).get(INSTANCING, {})
        if isinstance(instances, dict) and isinstance(instances.get("attributes"), dict):
            attributes = instances["attributes"]
            yield from (
                ([attributes], name) for name, index in attributes.items() if isinstance(index, int)
            )


def view_references(tree: dict[str, Any], accessors: list[dict[str, Any]]) -> Iterator[References]:
    """Yield all references to buffer views: of images, Draco data and the given accessors."""
    yield tree.get("images", []), "bufferView"
    yield accessors, "bufferView"
    sparse = [accessor["sparse"] for accessor in accessors if "sparse" in accessor]
    yield [each[part] for each in sparse for part in ("indices", "values")], "bufferView"
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            draco = primitive.get("extensions", {}).get("KHR_draco_mesh_compression")
            if draco is not None:
                yield [draco], "bufferView"
