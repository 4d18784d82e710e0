"""Creases: interior edges that are kept sharp on request, and followed through the levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int

from pns_common.errors import ParameterError
from pns_common.topology import EdgeClass, Topology


def with_creases(topology: Topology, creases: Int[np.ndarray, "N 2"]) -> Topology:
    """The topology with those of its interior edges as creases that the vertex pairs name.

    Raises:
        ParameterError: a pair is no edge of the mesh.
    """
    count = np.int64(topology.vertex_count)
    keys = topology.edges[:, 0] * count + topology.edges[:, 1]
    named = _checked(creases, topology.vertex_count)
    named = named.min(axis=1) * count + named.max(axis=1)
    lost = named[~np.isin(named, keys)]
    if len(lost):
        raise ParameterError("creases", divmod(int(lost[0]), int(count)), expected="edges")
    edge_class = topology.edge_class.copy()
    edge_class[np.isin(keys, named) & (edge_class == EdgeClass.INTERIOR)] = EdgeClass.CREASE
    interior = np.flatnonzero(edge_class == EdgeClass.INTERIOR)
    return replace(topology, edge_class=edge_class, interior=interior)


def crease_children(topology: Topology) -> Int[np.ndarray, "N 2"]:
    """The halves of the crease edges, as vertex pairs of the split mesh."""
    edges = np.flatnonzero(topology.edge_class == EdgeClass.CREASE)
    middle = topology.vertex_count + edges
    ends = topology.edges[edges]
    return np.stack([ends, np.stack([middle, middle], axis=1)], axis=-1).reshape(-1, 2)


def _checked(creases: Int[np.ndarray, "N 2"], vertex_count: int) -> Int[np.ndarray, "N 2"]:
    """The pairs, refused unless they are pairs of vertices."""
    pairs = np.asarray(creases)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise ParameterError("creases", pairs.shape, expected="an integer array of shape (N, 2)")
    outside = (pairs < 0) | (pairs >= vertex_count)
    if outside.any():
        worst = pairs[outside.any(axis=1)][0].tolist()
        raise ParameterError("creases", worst, expected=f"vertices 0 … {vertex_count - 1}")
    return pairs.astype(np.int64)
