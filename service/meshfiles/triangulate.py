"""Cut the polygons of a file, with what their corners and faces carry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from pns_common.mesh.cutting import BLOCK, Cut, convex_pieces, cut_polygons, newell

from ..changes import counted
from .mesh_file import MeshFile, offsets_of


def triangulated(mesh: MeshFile) -> MeshFile:
    """Return the same surface as triangles, in the order of the polygons."""
    if (mesh.sizes == 3).all():
        return mesh
    cuts = [*cut_blocks(mesh)]
    polygon = np.concatenate([cut.polygon for cut in cuts])
    order = np.argsort(polygon, kind="stable")
    polygon = polygon[order]
    places = np.concatenate([cut.places for cut in cuts])[order]
    crossed = sum(cut.crossed for cut in cuts)
    told = {"polygons-cut": len(polygon) - len(mesh.sizes), "polygons-crossed": crossed}
    return mesh.cut(places, polygon).with_changes(counted(told))


def in_star_shaped_pieces(mesh: MeshFile) -> MeshFile:
    """Return polygons with the concave ones in convex pieces; see ``pns_common.mesh.cutting``."""
    pieces = convex_pieces(mesh.vertices, mesh.offsets, mesh.corners)
    told = {"concave-cut": pieces.cut, "concave-crossed": pieces.crossed}
    if pieces.cut:
        mesh = mesh.taken(pieces.offsets, pieces.places, pieces.face)
    return mesh.with_changes(counted(told))


def cut_blocks(mesh: MeshFile) -> Iterator[Cut]:
    """Cut polygons some at a time: what that takes is many times what is left."""
    sizes = mesh.sizes
    whole = np.flatnonzero(sizes == 3)
    yield Cut(mesh.offsets[whole, None] + np.arange(3), whole, 0)
    larger = np.flatnonzero(sizes > 3)
    for begin in range(0, len(larger), BLOCK):
        chosen = larger[begin : begin + BLOCK]
        offsets = offsets_of(sizes[chosen])
        place = np.repeat(mesh.offsets[chosen] - offsets[:-1], sizes[chosen])
        place += np.arange(len(place))
        # Of coordinates near the largest numbers areas may be infinite: such polygons become fans.
        with np.errstate(over="ignore", invalid="ignore"):
            cut = cut_polygons(mesh.vertices, offsets, mesh.corners[place])
        yield Cut(place[cut.places], chosen[cut.polygon], cut.crossed)


def area_vectors(mesh: MeshFile) -> Float[np.ndarray, "F 3"]:
    """Return twice the area of each polygon along its normal."""
    points = mesh.vertices[mesh.corners]
    return newell(points - points[np.repeat(mesh.offsets[:-1], mesh.sizes)], mesh.offsets)
