"""What becomes of each vertex attribute at the refined vertices of a primitive."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, Shaped

from service.gltf.normals import perpendicular_tangents, safe_unit
from service.gltf.primitives import TrianglePrimitive
from service.gltf.spread import Spread


def refined_attributes(
    primitive: TrianglePrimitive,
    row: Int[np.ndarray, " C"],
    spread: Spread,
    positions: Float[np.ndarray, "N 3"],
    normals: Float[np.ndarray, "N 3"] | None,
) -> dict[str, Shaped[np.ndarray, "N K"]]:
    """The attributes in the order of the file, each in the component type that it had.

    `row` is a row of the primitive's attributes for each distinct corner of `spread`.
    """
    refined: dict[str, Shaped[np.ndarray, "N K"]] = {}
    for name, values in primitive.attributes.items():
        corners = values[row]
        if name == "POSITION":
            refined[name] = positions.astype(np.float32)
        elif name == "NORMAL" and normals is not None:
            refined[name] = normals.astype(np.float32)
        elif name == "TANGENT":
            refined[name] = _tangents(corners, spread, normals)
        elif values.dtype.kind == "f":
            refined[name] = spread.linear(corners).astype(np.float32)
        elif primitive.accessors[name].normalized:
            refined[name] = np.rint(spread.linear(corners)).astype(values.dtype)
        else:
            # Identifiers have no average.
            refined[name] = spread.nearest(corners)
    return refined


def _tangents(
    corners: Float[np.ndarray, "C 4"], spread: Spread, normals: Float[np.ndarray, "N 3"] | None
) -> Float[np.ndarray, "N 4"]:
    """Interpolated, at a right angle to the new normal; w (±1, a handedness) from a corner."""
    direction = spread.linear(corners[:, :3])
    unit = safe_unit(direction) if normals is None else perpendicular_tangents(direction, normals)
    return np.hstack([unit, spread.nearest(corners[:, 3:])]).astype(np.float32)
