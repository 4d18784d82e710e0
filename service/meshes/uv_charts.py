"""Texture coordinates: linear, or refined by the masks of a scheme inside the charts they form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.charts import chart_points, refine_charts
from pns_common.carry.columns import level_topologies
from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.topology import following
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes import LOOP, BaseScheme

from ..options import Options
from .barycentric_grid import at_quad_points
from .split_connectivity import SplitConnectivity

# How C corners at vertices (C,) of the mesh to refine spread their texture coordinates (C, 2) over
# (N, 2).
UvBlend = Callable[
    [Any, Int[np.ndarray, " C"], Shaped[np.ndarray, "C 2"]], Float[np.ndarray, "N 2"]
]


def uv_blend(options: Options, creases: Creases, base: BaseScheme = LOOP) -> UvBlend:
    """Return the rule that the options name; `creases` are named edges of the mesh to refine.

    Pairs of triangles are quads to a base scheme of polygons.
    """
    if options.uv == "linear":
        return linear_uv
    return partial(smooth_uv, creases=creases, base=base, limit=options.limit)


def linear_uv(
    connectivity: Any, vertex: Int[np.ndarray, " C"], uv: Shaped[np.ndarray, "C 2"]
) -> Float[np.ndarray, "N 2"]:
    """Blend linearly in each face of the control mesh: textures lie as they lay."""
    return connectivity.linear(uv)


def smooth_uv(
    connectivity: SplitConnectivity,
    vertex: Int[np.ndarray, " C"],
    uv: Shaped[np.ndarray, "C 2"],
    creases: Creases,
    base: BaseScheme = LOOP,
    *,
    limit: bool = False,
) -> Float[np.ndarray, "N 2"]:
    """Blend by the base scheme's masks inside charts; see `refined_charts`."""
    grid, faces = connectivity.grid, connectivity.faces
    levels = grid.segments.bit_length() - 1
    if levels == 0:
        return connectivity.linear(uv)
    if base.polygons:
        faces = faces.reshape(-1, 6)[:, [0, 1, 2, 5]]
    flat, degree = faces.reshape(-1), faces.shape[1]
    offsets = np.arange(0, len(flat) + 1, degree)
    asked = uv[flat], vertex[flat], offsets, levels, creases, base
    columns, refined = refined_charts(*asked, limit=limit)
    descendants = refined.reshape(len(faces), -1)
    at_points = (
        at_quad_points(descendants, levels)
        if base.polygons
        else np.take(descendants, grid.slot, axis=1)
    )
    return columns[connectivity.at_vertices(at_points)]


def refined_charts(
    uv: Shaped[np.ndarray, "H 2"],
    vertex: Int[np.ndarray, " H"],
    offsets: Int[np.ndarray, " F1"],
    levels: int,
    creases: Creases,
    base: BaseScheme = LOOP,
    *,
    limit: bool = False,
) -> tuple[Float[np.ndarray, "N 2"], Int[np.ndarray, "G K"]]:
    """Refine values at the corners of faces, whose creases are named by their vertices.

    Creases inside a chart are creases of its stencil too, at the levels at which they are sharp.
    Return the refined values, and those of the corners of the refined faces.
    """
    points, first = chart_points(vertex, uv)
    sharp, blocks = _in_charts(creases, points, offsets, vertex[first]), Blocks(available_threads())
    charts = level_topologies((points, offsets), len(first), levels, sharp, base, blocks)
    return refine_charts(uv[first].astype(np.float64), charts, base, blocks, limit=limit)


def _in_charts(
    creases: Creases,
    corners: Int[np.ndarray, " H"],
    offsets: Int[np.ndarray, " F1"],
    vertex: Int[np.ndarray, " P"],
) -> Creases:
    """Return the sides of faces over points of charts that lie on named pairs of vertices."""
    named = creases.named
    if named is None or len(named) == 0:
        return NO_CREASES
    sides = np.stack([corners, corners[following(offsets)]], axis=1)
    count = int(max(vertex.max(), named.max())) + 1
    ends, wanted = (np.sort(pairs, axis=1) @ [count, 1] for pairs in (vertex[sides], named))
    kept = np.isin(ends, wanted)
    if creases.soft_corners is not None:
        creases = replace(creases, soft_corners=creases.soft_corners[vertex])
    if creases.sharpness is None:
        return replace(creases, named=sides[kept])
    # Of a pair that is named twice the sharper one counts.
    order = np.lexsort((creases.sharpness, wanted))
    place = np.searchsorted(wanted[order], ends[kept], side="right") - 1
    return replace(creases, named=sides[kept], sharpness=creases.sharpness[order[place]])
