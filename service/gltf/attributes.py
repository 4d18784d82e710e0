"""What becomes of each vertex attribute at the refined vertices of a primitive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from service.gltf.charts import UvBlend
from service.gltf.followers import Followers
from service.gltf.normals import perpendicular_tangents, safe_unit
from service.gltf.primitives import TrianglePrimitive
from service.gltf.schema import Accessor
from service.gltf.skins import skin_attributes
from service.gltf.spread import Spread


@dataclass(frozen=True, eq=False)
class RefinedVertices:
    """The N refined vertices of a primitive, and all that is not blended from its corners.

    Attributes:
        row: for each of the C corners a row of the primitive's attributes.
        welded: the welded vertex of each corner.
        spread: how corners spread over refined vertices.
        positions: the refined positions.
        normals: the new normals; None where the primitive has none.
        followers: skin binding and morph deltas.
        morphed_normals: for each morph target the normals under it; None where none is wanted.
    """

    row: Int[np.ndarray, " C"]
    welded: Int[np.ndarray, " C"]
    spread: Spread
    positions: Float[np.ndarray, "N 3"]
    normals: Float[np.ndarray, "N 3"] | None
    followers: Followers
    morphed_normals: tuple[Float[np.ndarray, "N 3"] | None, ...]


def refined_attributes(
    primitive: TrianglePrimitive, at: RefinedVertices, uv_blend: UvBlend
) -> dict[str, Shaped[np.ndarray, "N K"]]:
    """The attributes in the order of the file, each in the component type that it had."""
    skin: dict[str, Shaped[np.ndarray, "N 4"]] = {}
    if at.followers.binding is not None:
        skin = skin_attributes(primitive, at.followers.binding)
    refined: dict[str, Shaped[np.ndarray, "N K"]] = {}
    for name, values in primitive.attributes.items():
        corners = values[at.row]
        if name == "POSITION":
            refined[name] = at.positions.astype(np.float32)
        elif name == "NORMAL" and at.normals is not None:
            refined[name] = at.normals.astype(np.float32)
        elif name == "TANGENT":
            direction = tangent_directions(at.spread.linear(corners[:, :3]), at.normals)
            sign = at.spread.nearest(corners[:, 3:])
            refined[name] = np.hstack([direction, sign]).astype(np.float32)
        elif name in skin:
            refined[name] = skin[name]
        elif name.startswith("TEXCOORD_"):
            blended = uv_blend(at.spread, at.welded, corners)
            refined[name] = in_type_of(values, blended)
        else:
            refined[name] = blend(at.spread, corners, primitive.accessors[name])
    return refined


def blend(
    spread: Spread, corners: Shaped[np.ndarray, "C K"], accessor: Accessor
) -> Shaped[np.ndarray, "N K"]:
    """Fractions and floats linearly; identifiers, which have no average, from a nearest corner."""
    if corners.dtype.kind != "f" and not accessor.normalized:
        return spread.nearest(corners)
    return in_type_of(corners, spread.linear(corners))


def tangent_directions(
    directions: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"] | None
) -> Float[np.ndarray, "N 3"]:
    """Unit tangents at a right angle to the normals, where there are normals."""
    if normals is None:
        return safe_unit(directions)
    return perpendicular_tangents(directions, normals)


def in_type_of(
    old: Shaped[np.ndarray, "C K"], blended: Float[np.ndarray, "N K"]
) -> Shaped[np.ndarray, "N K"]:
    """Blended values in the component type that they had; integers rounded."""
    return (blended if old.dtype.kind == "f" else np.rint(blended)).astype(old.dtype)
