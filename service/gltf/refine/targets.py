"""What becomes of morph targets: deltas, added to refined attributes in proportion to a weight.

At weight 1 a target's normals are those of the surface that it makes, and its tangents lie at a
right angle to them; in between, the sum is linear, as every renderer computes it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Shaped

from ..read.primitives import TrianglePrimitive
from .attributes import RefinedVertices, blend, tangent_directions

Deltas = dict[str, Shaped[np.ndarray, "N K"]]


def refined_targets(
    primitive: TrianglePrimitive,
    refined_vertices: RefinedVertices,
    base: Mapping[str, Shaped[np.ndarray, "N K"]],
) -> list[Deltas]:
    """Refine the deltas of each target, as many and in their order; `base` is refined already."""
    return [
        _refined_target(primitive, refined_vertices, base, number)
        for number in range(len(primitive.targets))
    ]


def _refined_target(
    primitive: TrianglePrimitive,
    refined_vertices: RefinedVertices,
    base: Mapping[str, Shaped[np.ndarray, "N K"]],
    number: int,
) -> Deltas:
    refined: Deltas = {}
    normals = refined_vertices.morphed_normals[number]
    for name, values in primitive.targets[number].items():
        corners = values[refined_vertices.row]
        if name == "POSITION":
            refined[name] = refined_vertices.skin_and_morph.deltas[number]
        elif name == "NORMAL" and normals is not None:
            refined[name] = (normals - base[name]).astype(np.float32, copy=False)
        elif name == "TANGENT" and name in base:
            directions = refined_vertices.connectivity.linear(
                primitive.attributes[name][refined_vertices.row, :3] + corners
            )
            under = normals if "NORMAL" in primitive.targets[number] else None
            morphed = tangent_directions(
                directions, refined_vertices.exact_normals if under is None else under
            )
            refined[name] = (morphed - base[name][:, :3]).astype(np.float32)
        else:
            refined[name] = blend(
                name,
                refined_vertices.connectivity,
                corners,
                primitive.target_accessors[number][name],
            )
    return refined
