"""Texture coordinates: linear, or refined by Loop's stencil inside the charts that they form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.columns import level_topologies
from pns_common.creases import NO_CREASES, Creases
from pns_common.parallel import Blocks, available_threads
from pns_common.rows import as_words, distinct_rows, number_by_first_appearance
from pns_common.schemes import LOOP
from pns_common.topology import EdgeClass, Topology, split_faces

from ..options import Options
from .split_connectivity import SplitConnectivity

# How C corners at vertices (C,) of the mesh to refine spread their texture coordinates (C, 2) over
# (N, 2).
UvBlend = Callable[
    [SplitConnectivity, Int[np.ndarray, " C"], Shaped[np.ndarray, "C 2"]], Float[np.ndarray, "N 2"]
]


def uv_blend(options: Options, creases: Creases) -> UvBlend:
    """Return the rule that the options name; `creases` are named edges of the mesh to refine."""
    return partial(smooth_uv, creases=creases) if options.uv == "smooth" else linear_uv


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
) -> Float[np.ndarray, "N 2"]:
    """Blend by Loop's stencil inside charts; seams and the charts' boundaries stay linear.

    A chart is a piece of the surface within which texture coordinates are continuous: corners are
    one where vertex and coordinates are. Creases inside it are creases of its stencil too, at the
    levels at which they are sharp, so that textures lie beside them as they lay.
    """
    corner = distinct_rows(np.hstack([as_words(vertex[:, None]), as_words(uv)]))
    flat, first = number_by_first_appearance(corner[connectivity.faces.reshape(-1)])
    corner_of = connectivity.faces.reshape(-1)[first]
    columns, faces = uv[corner_of].astype(np.float64), flat.reshape(-1, 3)
    grid = connectivity.grid
    levels = grid.segments.bit_length() - 1
    sharp = _in_charts(creases, faces, vertex[corner_of])
    blocks = Blocks(available_threads())
    topologies = level_topologies(faces, len(columns), levels, sharp, blocks=blocks)
    for topology in topologies:
        columns = _refined(columns, topology, blocks)
    descendants = split_faces(topologies[-1], blocks, np.int64).reshape(len(faces), -1)
    return columns[connectivity.at_vertices(np.take(descendants, grid.slot, axis=1))]


def _in_charts(
    creases: Creases, faces: Int[np.ndarray, "F 3"], vertex: Int[np.ndarray, " P"]
) -> Creases:
    """Return the sides of faces over points of charts that lie on named pairs of vertices."""
    named = creases.named
    if named is None or len(named) == 0:
        return NO_CREASES
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = int(max(vertex.max(), named.max())) + 1
    ends, wanted = (np.sort(pairs, axis=1) @ [count, 1] for pairs in (vertex[sides], named))
    kept = np.isin(ends, wanted)
    if creases.sharpness is None:
        return replace(creases, named=sides[kept])
    # Of a pair that is named twice the sharper one counts.
    order = np.lexsort((creases.sharpness, wanted))
    place = np.searchsorted(wanted[order], ends[kept], side="right") - 1
    return replace(creases, named=sides[kept], sharpness=creases.sharpness[order[place]])


def _refined(
    columns: Float[np.ndarray, "V 2"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W 2"]:
    """Refine by Loop's masks; vertices on a boundary stay, as in linear blending."""
    rim = (topology.edge_class != EdgeClass.INTERIOR) & (topology.edge_class != EdgeClass.CREASE)
    at_rim, refined = topology.edges[rim].reshape(-1), LOOP.place(columns, topology, blocks)
    refined[at_rim] = columns[at_rim]
    return refined
