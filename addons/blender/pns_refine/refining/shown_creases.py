"""Edges that a mesh shows to be sharp: lines of its shape, and hard edges of smooth shading."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from pns_common import Creases, Mesh
from pns_common.crease_lines import named_on
from pns_common.fused.interior_edges import interior_edges
from pns_common.geometry.shaded_smooth import shaded_smooth

from .snapshot import Domain, Snapshot, edge_keys


def shown_creases(snapshot: Snapshot, asked: Creases) -> Creases:
    """Return what is asked for, by name; with lines also the hard edges of a smooth mesh."""
    lines = named_on(Mesh(snapshot.points, snapshot.triangles), asked)
    if asked.line_angle is None or lines.named is None:
        return lines
    named = np.concatenate([hard_edges_of_smooth(snapshot), lines.named])
    return Creases(named, levels=lines.levels)


def hard_edges_of_smooth(snapshot: Snapshot) -> Int[np.ndarray, "N 2"]:
    """Return the edges that are marked sharp or lie at flat faces, if the mesh is shaded smooth."""
    triangles, points = snapshot.triangles, snapshot.points
    edges, half_edges = interior_edges(triangles, len(points))
    faces = half_edges // 3
    polygons = snapshot.polygons[faces]
    flat = _marked(snapshot, "sharp_face", Domain.FACE, len(snapshot.polygon_corners) - 1)
    marked = snapshot.edges[_marked(snapshot, "sharp_edge", Domain.EDGE, len(snapshot.edges))]
    hard = flat[polygons].any(axis=1) | np.isin(edge_keys(edges), edge_keys(marked))
    # A polygon's own diagonals have one normal on both sides.
    hard &= polygons[:, 0] != polygons[:, 1]
    if not hard.any() or not shaded_smooth(points, triangles, faces, ~hard)[0]:
        return np.empty((0, 2), dtype=np.int64)
    return edges[hard].astype(np.int64)


def _marked(snapshot: Snapshot, name: str, domain: Domain, count: int) -> Bool[np.ndarray, " N"]:
    """Return where an attribute of this name is set; nowhere, where there is none."""
    for layer in snapshot.layers:
        if layer.name == name and layer.domain is domain:
            return layer.values.reshape(count, -1)[:, 0].astype(bool)
    return np.zeros(count, dtype=bool)
