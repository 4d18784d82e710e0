"""Edges of a mesh that the options keep sharp: the one place that reads `crease` for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from pns_common.mesh.creases import NO_CREASES, Creases, edge_cosines
from pns_common.mesh.mesh import Mesh
from pns_common.mesh.rows import marked
from pns_common.mesh.topology import Topology, following
from pns_common.operator.scheme import Scheme
from pns_common.operator.sharpness import creases_by_name

from ..options import Options


def chosen_creases(
    mesh: Mesh,
    options: Options,
    scheme: Scheme,
    hard: Callable[[], Int[np.ndarray, "N 2"]],
    found: Callable[[], Creases] | None = None,
) -> Creases:
    """Return the edges of a mesh that the options keep sharp, by name.

    With `crease=auto` these are the scheme's: none for Loop and models of format 1.

    Args:
        mesh: the mesh to refine.
        options, scheme: how it is refined.
        hard: returns the edges that its normals make hard.
        found: returns those that the scheme finds, if they are not those of the mesh as a whole.
    """
    creases = NO_CREASES
    if options.crease == "normals":
        creases = Creases(hard())
    elif options.crease == "auto" and scheme.creases.finds:
        creases = found() if found else creases_by_name(mesh, scheme.creases, scheme)
    elif options.crease_angle is not None:
        topology = mesh.topology()
        rows = np.flatnonzero(edge_cosines(mesh.vertices, topology) < np.cos(options.crease_angle))
        creases = Creases(topology.edges[rows].astype(np.int64))
    return replace(creases, border=options.border)


def hard_edges(topology: Topology, label: Int[np.ndarray, " H"]) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges whose two faces have different labels at both ends.

    Pairs of vertices, the lower first. Both ends count: the sides of a cone share normals along its
    base and differ at its tip alone, and the cone is smooth. A label below 0 makes no edge hard.
    """
    vertex = topology.corners
    of_vertex = np.empty(topology.vertex_count, dtype=label.dtype)
    of_vertex[vertex] = label
    several = marked(vertex[of_vertex[vertex] != label], len(of_vertex))
    edges, half_edges = topology.edges[topology.interior], topology.half_edges[topology.interior]
    asked = np.flatnonzero(several[edges].all(axis=1))
    hard = np.ones(len(asked), dtype=bool)
    there, back = half_edges[asked].T
    follow = following(topology.offsets)
    for corners, facing in ((there, follow[back]), (follow[there], back)):
        first, second = label[corners], label[facing]
        hard &= (first >= 0) & (second >= 0) & (first != second)
    return edges[asked[hard]].astype(np.int64)
