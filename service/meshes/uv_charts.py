"""Texture coordinates: linear, or refined by the masks of a scheme inside the charts they form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.columns import level_topologies
from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.rows import as_words, distinct_rows, number_by_first_appearance
from pns_common.mesh.topology import EdgeClass, Topology, following
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes import LOOP, BaseScheme

from ..options import Options
from .barycentric_grid import at_quad_points
from .split_connectivity import SplitConnectivity

# How C corners at vertices (C,) of the mesh to refine spread their texture coordinates (C, 2) over
# (N, 2).
UvBlend = Callable[
    [SplitConnectivity, Int[np.ndarray, " C"], Shaped[np.ndarray, "C 2"]], Float[np.ndarray, "N 2"]
]


def uv_blend(options: Options, creases: Creases, base: BaseScheme = LOOP) -> UvBlend:
    """Return the rule that the options name; `creases` are named edges of the mesh to refine.

    Pairs of triangles are quads to a base scheme of polygons.
    """
    return partial(smooth_uv, creases=creases, base=base) if options.uv == "smooth" else linear_uv


def linear_uv(
    connectivity: SplitConnectivity, vertex: Int[np.ndarray, " C"], uv: Shaped[np.ndarray, "C 2"]
) -> Float[np.ndarray, "N 2"]:
    """Blend linearly in each face of the control mesh: textures lie as they lay."""
    return connectivity.linear(uv)


def smooth_uv(
    connectivity: SplitConnectivity,
    vertex: Int[np.ndarray, " C"],
    uv: Shaped[np.ndarray, "C 2"],
    creases: Creases,
    base: BaseScheme = LOOP,
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
    columns, refined = refined_charts(uv[flat], vertex[flat], offsets, levels, creases, base)
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
) -> tuple[Float[np.ndarray, "N 2"], Int[np.ndarray, "G K"]]:
    """Refine values at the corners of faces by the masks inside charts; seams and rims stay linear.

    A chart is a piece of the surface within which texture coordinates are continuous: corners are
    one where vertex and coordinates are. Creases inside it are creases of its stencil too, at the
    levels at which they are sharp, so that textures lie beside them as they lay. Returns the
    refined values, and those of the corners of the refined faces.
    """
    corner = distinct_rows(np.hstack([as_words(vertex[:, None]), as_words(uv)]))
    flat, first = number_by_first_appearance(corner)
    columns = uv[first].astype(np.float64)
    sharp = _in_charts(creases, flat, offsets, vertex[first])
    blocks = Blocks(available_threads())
    topologies = level_topologies((flat, offsets), len(columns), levels, sharp, base, blocks)
    for topology in topologies:
        columns = _refined(columns, topology, blocks, base)
    return columns, base.faces(topologies[-1], blocks, np.int64)


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


def _refined(
    columns: Float[np.ndarray, "V 2"], topology: Topology, blocks: Blocks, base: BaseScheme
) -> Float[np.ndarray, "W 2"]:
    """Refine by the base scheme's masks; vertices on a boundary stay, as in linear blending."""
    rim = (topology.edge_class != EdgeClass.INTERIOR) & (topology.edge_class != EdgeClass.CREASE)
    at_rim, refined = topology.edges[rim].reshape(-1), base.place(columns, topology, blocks)
    refined[at_rim] = columns[at_rim]
    return refined
