"""Creases: interior edges that are kept sharp on request, and followed through the levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.topology import EdgeClass, Topology
from pns_common.errors import ParameterError


def with_creases(topology: Topology, creases: Int[np.ndarray, "N 2"]) -> Topology:
    """Return the topology with those interior edges as creases that the vertex pairs name.

    Raises:
        ParameterError: a pair is no edge of the mesh.
    """
    edge_class = crease_classes(topology.edges, topology.edge_class, topology.vertex_count, creases)
    interior = np.flatnonzero(edge_class == EdgeClass.INTERIOR)
    return replace(topology, edge_class=edge_class, interior=interior)


def crease_classes(
    edges: Int[np.ndarray, "E 2"],
    edge_class: Int[np.ndarray, " E"],
    vertex_count: int,
    creases: Int[np.ndarray, "N 2"],
) -> Int[np.ndarray, " E"]:
    """Return the classes of the edges; interior ones that the vertex pairs name are creases.

    Raises:
        ParameterError: a pair is no edge.
    """
    count = np.int64(vertex_count)
    keys = edges[:, 0] * count + edges[:, 1]
    named = _checked(creases, vertex_count)
    named = named.min(axis=1) * count + named.max(axis=1)
    lost = named[~np.isin(named, keys)]
    if len(lost):
        raise ParameterError("creases", divmod(int(lost[0]), int(count)), expected="edges")
    kept = np.isin(keys, named) & (edge_class == EdgeClass.INTERIOR)
    return np.where(kept, np.int8(EdgeClass.CREASE), edge_class)


def crease_children(topology: Topology) -> Int[np.ndarray, "N 2"]:
    """Return the halves of the crease edges, as vertex pairs of the split mesh."""
    return crease_halves(topology.edges, topology.edge_class, topology.vertex_count)


def crease_halves(
    edges: Int[np.ndarray, "E 2"], edge_class: Int[np.ndarray, " E"], vertex_count: int
) -> Int[np.ndarray, "N 2"]:
    """Return the same from the arrays."""
    creases = np.flatnonzero(edge_class == EdgeClass.CREASE)
    middle = vertex_count + creases
    return np.stack([edges[creases], np.stack([middle, middle], axis=1)], axis=-1).reshape(-1, 2)


def _checked(creases: Int[np.ndarray, "N 2"], vertex_count: int) -> Int[np.ndarray, "N 2"]:
    """Return the pairs, refused unless they are pairs of vertices."""
    pairs = np.asarray(creases)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise ParameterError("creases", pairs.shape, expected="an integer array of shape (N, 2)")
    outside = (pairs < 0) | (pairs >= vertex_count)
    if outside.any():
        worst = pairs[outside.any(axis=1)][0].tolist()
        raise ParameterError("creases", worst, expected=f"vertices 0 … {vertex_count - 1}")
    return pairs.astype(np.int64)
