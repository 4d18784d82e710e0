"""Where a document names accessors and buffer views by number, extensions included."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

INSTANCING = "EXT_mesh_gpu_instancing"
# Extensions that name no accessor or buffer view, or name them where `references` looks.
KNOWN = frozenset(
    {
        INSTANCING,
        "EXT_instance_features",
        "EXT_lights_image_based",
        "EXT_mesh_features",
        "EXT_meshopt_compression",
        "EXT_texture_avif",
        "EXT_texture_webp",
        "FB_ngon_encoding",
        "GODOT_single_root",
        "KHR_animation_pointer",
        "KHR_draco_mesh_compression",
        "KHR_gaussian_splatting",
        "KHR_implicit_shapes",
        "KHR_lights_punctual",
        "KHR_materials_anisotropy",
        "KHR_materials_clearcoat",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_dispersion",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_iridescence",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_sheen",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_variants",
        "KHR_materials_volume",
        "KHR_mesh_quantization",
        "KHR_meshopt_compression",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_node_visibility",
        "KHR_physics_rigid_bodies",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "KHR_xmp_json_ld",
        "MSFT_lod",
        "MSFT_packing_normalRoughnessMetallic",
        "MSFT_packing_occlusionRoughnessMetallic",
        "MSFT_texture_dds",
        "VRM",
        "VRMC_materials_hdr_emissiveMultiplier",
        "VRMC_materials_mtoon",
        "VRMC_node_constraint",
        "VRMC_springBone",
        "VRMC_springBone_extended_collider",
        "VRMC_vrm",
        "VRMC_vrm_animation",
    }
)


# Numbers at `holder[key]`, of each holder that has this key. One such list has all samplers of an
# animation: an object for each number takes three times as long.
References = tuple[Sequence[dict[str, Any]], str]


def unknown_extensions(tree: dict[str, Any], text: bytes) -> list[str]:
    """Return the extensions in use that may hold numbers which `references` does not see.

    `text` is the JSON that the tree came from: most files have no extension, and a search tells.
    """
    names = {name for key in ("extensionsUsed", "extensionsRequired") for name in tree.get(key, [])}
    # An escape could spell the word too.
    pending: list[Any] = [tree] if b'"extensions"' in text or b"\\u" in text else []
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            if isinstance(value.get("extensions"), dict):
                # Not |=, which copies all the names so far for each holder of keys.
                names.update(value["extensions"])
            # What applications keep in extras is theirs, and no part of the document's structure.
            pending += [part for key, part in value.items() if key != "extras"]
        elif isinstance(value, list):
            pending += value
    return sorted(names - KNOWN)


def accessor_references(tree: dict[str, Any]) -> Iterator[References]:
    """Yield every place that names an accessor."""
    for mesh in tree.get("meshes", []):
        primitives = mesh.get("primitives", [])
        yield primitives, "indices"
        for primitive in primitives:
            for attributes in (primitive["attributes"], *primitive.get("targets", [])):
                yield from (([attributes], name) for name in attributes)
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
    """Yield every place that names a buffer view: images, and those of the given accessors."""
    yield tree.get("images", []), "bufferView"
    yield accessors, "bufferView"
    sparse = [accessor["sparse"] for accessor in accessors if "sparse" in accessor]
    yield [each[part] for each in sparse for part in ("indices", "values")], "bufferView"
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            draco = primitive.get("extensions", {}).get("KHR_draco_mesh_compression")
            if draco is not None:
                yield [draco], "bufferView"
