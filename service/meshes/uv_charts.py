"""Texture coordinates: linear, or refined by Loop's stencil inside the charts that they form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.base.distinct import as_words, distinct_rows, number_by_first_appearance
from pns_common.connectivity.topology import Topology, sharp_edge_count, split
from pns_common.masks.linear import level_topologies
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices

from ..options import Options
from .split_connectivity import SplitConnectivity

# How C corners over welded vertices (C,) spread their texture coordinates (C, 2) over (N, 2).
UvBlend = Callable[
    [SplitConnectivity, Int[np.ndarray, " C"], Shaped[np.ndarray, "C 2"]], Float[np.ndarray, "N 2"]
]


def uv_blend(options: Options) -> UvBlend:
    """Return the rule that the options name."""
    return smooth_uv if options.uv == "smooth" else linear_uv


def linear_uv(
    connectivity: SplitConnectivity, vertex: Int[np.ndarray, " C"], uv: Shaped[np.ndarray, "C 2"]
) -> Float[np.ndarray, "N 2"]:
    """Blend linearly in each face of the control mesh: textures lie as they lay."""
    return connectivity.linear(uv)


def smooth_uv(
    connectivity: SplitConnectivity, vertex: Int[np.ndarray, " C"], uv: Shaped[np.ndarray, "C 2"]
) -> Float[np.ndarray, "N 2"]:
    """Blend by Loop's stencil inside charts; seams and the charts' boundaries stay linear.

    A chart is a piece of the surface within which texture coordinates are continuous: corners are
    one where vertex and coordinates are.
    """
    corner = distinct_rows(np.hstack([as_words(vertex[:, None]), as_words(uv)]))
    flat, first = number_by_first_appearance(corner[connectivity.faces.reshape(-1)])
    columns = uv[connectivity.faces.reshape(-1)[first]].astype(np.float64)
    grid = connectivity.grid
    levels = grid.segments.bit_length() - 1
    topologies = level_topologies(flat.reshape(-1, 3), len(columns), levels)
    for topology in topologies:
        columns = np.concatenate(
            [_chart_vertices(columns, topology), loop_edge_vertices(columns, topology)]
        )
    descendants = split(topologies[-1]).reshape(len(connectivity.faces), -1)
    return columns[connectivity.at_vertices(np.take(descendants, grid.slot, axis=1))]


def _chart_vertices(
    columns: Float[np.ndarray, "V 2"], topology: Topology
) -> Float[np.ndarray, "V 2"]:
    """Move vertices inside by Loop's rule; on a boundary they stay, as in linear blending."""
    inside = sharp_edge_count(topology) == 0
    return np.where(inside[:, None], loop_vertex_vertices(columns, topology), columns)
