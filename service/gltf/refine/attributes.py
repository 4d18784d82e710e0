"""What becomes of each vertex attribute at the refined vertices of a primitive."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.base.blocks import Blocks, available_threads
from pns_common.fused.where_loaded.tangents import perpendicular_tangents

from ...meshes.split_connectivity import SplitConnectivity
from ...meshes.uv_charts import UvBlend
from ..read.primitives import TrianglePrimitive
from ..read.schema import Accessor
from .normals import safe_unit
from .skin_and_morph import SkinAndMorph
from .skins import skin_attributes

# EXT_mesh_features and batched 3D tiles number features, as floats where 16 bits do not suffice:
# no accessor of vertices may hold wider integers.
_IDENTIFIER = re.compile(r"_?FEATURE_ID_[0-9]+|_BATCHID")


@dataclass(frozen=True, eq=False)
class RefinedVertices:
    """The N refined vertices of a primitive, and all that is not blended from its corners.

    Attributes:
        row: for each of the C corners a row of the primitive's attributes.
        vertex: of the mesh that was refined, for each corner.
        connectivity: how corners spread over refined vertices.
        positions: the refined positions, in float32.
        normals: the new normals, in float32; None where the primitive has none.
        exact_normals: the same in float64, for tangents; None where the primitive has none of both.
        skin_and_morph: skin binding and morph deltas.
        morphed_normals: for each morph target the normals under it; None where none is wanted.
    """

    row: Int[np.ndarray, " C"]
    vertex: Int[np.ndarray, " C"]
    connectivity: SplitConnectivity
    positions: Float[np.ndarray, "N 3"]
    normals: Float[np.ndarray, "N 3"] | None
    exact_normals: Float[np.ndarray, "N 3"] | None
    skin_and_morph: SkinAndMorph
    morphed_normals: tuple[Float[np.ndarray, "N 3"] | None, ...]


def refined_attributes(
    primitive: TrianglePrimitive, refined_vertices: RefinedVertices, uv_blend: UvBlend
) -> dict[str, Shaped[np.ndarray, "N K"]]:
    """Return the attributes in the order of the file, each in the component type that it had."""
    skin: dict[str, Shaped[np.ndarray, "N 4"]] = {}
    if refined_vertices.skin_and_morph.binding is not None:
        skin = skin_attributes(primitive, refined_vertices.skin_and_morph.binding)
    refined: dict[str, Shaped[np.ndarray, "N K"]] = {}
    for name, values in primitive.attributes.items():
        corners = values[refined_vertices.row]
        if name == "POSITION":
            refined[name] = refined_vertices.positions
        elif name == "NORMAL" and refined_vertices.normals is not None:
            refined[name] = refined_vertices.normals
        elif name == "TANGENT":
            direction = tangent_directions(
                refined_vertices.connectivity.linear(corners[:, :3]),
                refined_vertices.exact_normals,
            )
            sign = refined_vertices.connectivity.nearest(corners[:, 3:])
            refined[name] = np.hstack([direction, sign]).astype(np.float32)
        elif name in skin:
            refined[name] = skin[name]
        elif name.startswith("TEXCOORD_"):
            blended = uv_blend(refined_vertices.connectivity, refined_vertices.vertex, corners)
            refined[name] = in_type_of(values, blended)
        else:
            refined[name] = blend(
                name, refined_vertices.connectivity, corners, primitive.accessors[name]
            )
    return refined


def blend(
    name: str,
    connectivity: SplitConnectivity,
    corners: Shaped[np.ndarray, "C K"],
    accessor: Accessor,
) -> Shaped[np.ndarray, "N K"]:
    """Blend linearly: fractions, floats, colours; identifiers, which have no mean, by nearness."""
    fraction = accessor.normalized or name.startswith("COLOR_")
    whole = corners.dtype.kind != "f" and not fraction
    if whole or _IDENTIFIER.fullmatch(name):
        return connectivity.nearest(corners)
    return in_type_of(corners, connectivity.linear(corners))


def tangent_directions(
    directions: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"] | None
) -> Float[np.ndarray, "N 3"]:
    """Return unit tangents at a right angle to the normals, where there are normals."""
    if normals is None:
        return safe_unit(directions)
    return perpendicular_tangents(directions, normals, Blocks(available_threads()))


def in_type_of(
    old: Shaped[np.ndarray, "C K"], blended: Float[np.ndarray, "N K"]
) -> Shaped[np.ndarray, "N K"]:
    """Return blended values in the component type that they had; integers rounded, in place."""
    return (blended if old.dtype.kind == "f" else np.rint(blended, out=blended)).astype(old.dtype)
