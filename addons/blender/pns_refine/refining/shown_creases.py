"""Edges that a mesh shows to be sharp: by their angle, and hard edges of smooth shading."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int, Shaped

from pns_common import Creases, Scheme
from pns_common.mesh.creases import NO_CREASES
from pns_common.mesh.topology import Topology
from pns_common.operator.sharpness import creases_by_name

from .snapshot import Control, Domain, Snapshot, edge_keys


def shown_creases(snapshot: Snapshot, control: Control, scheme: Scheme) -> Creases:
    """Return the creases of a scheme by name, with the hard edges that the mesh's shading marks.

    A mesh whose polygons meet at hard edges alone is flat-shaded, and marks none.
    """
    if not scheme.creases.finds:
        return NO_CREASES
    mesh = control.mesh
    topology, named = mesh.topology(), creases_by_name(mesh, scheme.creases, scheme)
    edges, hard = shaded_edges(snapshot, control, topology)
    return named if hard.all() else named.with_named(edges[hard])


def shaded_edges(
    snapshot: Snapshot, control: Control, topology: Topology
) -> tuple[Int[np.ndarray, "N 2"], Bool[np.ndarray, " N"]]:
    """Return the edges between two polygons, and which are marked sharp or lie at flat faces."""
    polygons = control.polygons[topology.face_of(topology.half_edges[topology.interior])]
    # A polygon's own diagonals have one normal on both sides.
    between = polygons[:, 0] != polygons[:, 1]
    polygons = polygons[between]
    edges = topology.edges[topology.interior][between].astype(np.int64)
    flat = _marked(snapshot, "sharp_face", Domain.FACE, len(snapshot.polygon_corners) - 1)
    marked = snapshot.edges[_marked(snapshot, "sharp_edge", Domain.EDGE, len(snapshot.edges))]
    hard = flat[polygons].any(axis=1)
    if len(marked):
        hard |= np.isin(edge_keys(edges), edge_keys(marked))
    return edges, hard


def _marked(snapshot: Snapshot, name: str, domain: Domain, count: int) -> Bool[np.ndarray, " N"]:
    """Return where an attribute of this name is set; nowhere, where there is none."""
    values = _values(snapshot, name, domain)
    return np.zeros(count, dtype=bool) if values is None else values.astype(bool)


def _values(snapshot: Snapshot, name: str, domain: Domain) -> Shaped[np.ndarray, " N"] | None:
    """Return the first column of an attribute of this name; None where there is none."""
    for layer in snapshot.layers:
        if layer.name == name and layer.domain is domain:
            return layer.values[:, 0]
    return None
