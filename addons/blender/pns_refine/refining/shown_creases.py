"""Edges that a mesh shows to be sharp: lines of its shape, and hard edges of smooth shading.

And borders of materials on its flat sides, which the shape does not show.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int, Shaped

from pns_common import Creases, Mesh
from pns_common.crease_lines import named_on
from pns_common.flat_borders import flat_borders
from pns_common.fused.where_loaded.interior_edges import interior_edges
from pns_common.geometry.shaded_smooth import shaded_smooth

from .snapshot import Domain, Snapshot, edge_keys


def shown_creases(snapshot: Snapshot, asked: Creases) -> Creases:
    """Return what is asked for, by name.

    With lines also the hard edges of a smooth mesh, and borders of materials on flat sides.
    """
    if asked.line_angle is None:
        return asked
    shown = _lines_and_hard_edges(snapshot, asked)
    material = _values(snapshot, "material_index", Domain.FACE)
    if material is None:
        return shown
    borders = flat_borders(snapshot.points, snapshot.triangles, material[snapshot.polygons])
    return shown.with_named(borders)


def _lines_and_hard_edges(snapshot: Snapshot, asked: Creases) -> Creases:
    mesh = Mesh(snapshot.points, snapshot.triangles)
    edges, faces, hard = shaded_edges(snapshot)
    if not hard.any():
        return named_on(mesh, asked)
    # Who said of some edges that they are hard meant others to be round.
    lines = named_on(mesh, asked, edges[~hard])
    if not shaded_smooth(snapshot.points, snapshot.triangles, faces, ~hard)[0]:
        return lines
    return lines.with_named(edges[hard])


def shaded_edges(
    snapshot: Snapshot,
) -> tuple[Int[np.ndarray, "I 2"], Int[np.ndarray, "I 2"], Bool[np.ndarray, " I"]]:
    """Return the interior edges, their faces, and which are marked sharp or lie at flat faces."""
    triangles, points = snapshot.triangles, snapshot.points
    edges, half_edges = interior_edges(triangles, len(points))
    faces = half_edges // 3
    polygons = snapshot.polygons[faces]
    flat = _marked(snapshot, "sharp_face", Domain.FACE, len(snapshot.polygon_corners) - 1)
    marked = snapshot.edges[_marked(snapshot, "sharp_edge", Domain.EDGE, len(snapshot.edges))]
    hard = flat[polygons].any(axis=1) | np.isin(edge_keys(edges), edge_keys(marked))
    # A polygon's own diagonals have one normal on both sides.
    hard &= polygons[:, 0] != polygons[:, 1]
    return edges.astype(np.int64), faces, hard


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
