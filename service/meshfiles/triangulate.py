"""Polygons as triangles, cut in the plane of each: concave ones by ears (mapbox-earcut).

Every corner stays a corner of a triangle, those on a straight side too: a neighbour may end there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.mesh.mesh import fans
from pns_common.mesh.rows import cross, dot, norm
from pns_common.mesh.topology import following

from ..report import Change
from .mesh_file import MeshFile, offsets_of

# Polygons that are cut together.
BLOCK = 2**14
# Of the polygon's area, or of the square of its size: what rounding leaves of nothing.
ROUNDING = 1e-12
# How much of its area cutting may gain or lose before it is tried from another corner.
EXACT = 1e-9
ATTEMPTS = 4
# Polygons of more corners are tried once: what crosses itself is no better from elsewhere.
MANY = 64


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
    told = {
        "triangles added by cutting polygons": len(polygon) - len(mesh.sizes),
        "polygons without an area or that cross themselves: their triangles may overlap": crossed,
    }
    changes = [Change("", what, count) for what, count in told.items() if count]
    return mesh.cut(places, polygon).with_changes(changes)


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


@dataclass(frozen=True, eq=False)
class Cut:
    """Polygons as triangles.

    Attributes:
        places: the places of each triangle's corners among those of the polygons.
        polygon: the polygon that each triangle is of.
        crossed: polygons that cross themselves or have no area.
    """

    places: Int[np.ndarray, "T 3"]
    polygon: Int[np.ndarray, " T"]
    crossed: int


def cut_polygons(
    vertices: Float[np.ndarray, "V 3"],
    offsets: Int[np.ndarray, " F1"],
    corners: Int[np.ndarray, " C"],
) -> Cut:
    """Cut polygons of three corners or more into triangles."""
    sizes = np.diff(offsets)
    pieces = sizes - 2
    starts = np.cumsum(pieces) - pieces
    places, polygon = fans(offsets)
    # Relative to a corner of its own: far from the origin products lose the polygon.
    points = vertices[corners]
    local = points - points[np.repeat(offsets[:-1], sizes)]
    normals = _newell(local, offsets)
    folded = _folded(local, places, normals[polygon])
    # A quad that is no fan from its first corner may be one from its second.
    wrong = np.logical_or.reduceat(folded, starts)
    quads = np.flatnonzero(wrong & (sizes == 4))
    other = offsets[quads][:, None, None] + np.array([[1, 2, 3], [1, 3, 0]])
    better = ~_folded(local, other.reshape(-1, 3), np.repeat(normals[quads], 2, axis=0))
    better = better.reshape(-1, 2).all(axis=1)
    begin = starts[quads[better]]
    places[begin[:, None] + np.arange(2)] = other[better]
    flat = ~normals.any(axis=1)
    crossed = int((~better).sum() + (wrong & flat)[sizes != 4].sum())
    wrong[quads], wrong[flat] = False, False
    keep = np.ones(len(places), dtype=bool)
    made: list[tuple[int, Int[np.ndarray, "t 3"]]] = []
    # One by one: such polygons are few, and each is cut on its own.
    for face in np.flatnonzero(wrong).tolist():
        share = slice(offsets[face], offsets[face + 1])
        flat = _in_plane(local[share], normals[face])
        ears = _by_ears(flat, corners[share])
        area = np.linalg.norm(normals[face]) * (1 + EXACT)
        crossed += int(ears is None or _areas(flat, ears).sum() > area)
        if ears is not None:
            keep[starts[face] : starts[face] + pieces[face]] = False
            made.append((face, ears + offsets[face]))
    if made:
        polygon = np.concatenate(
            [polygon[keep], *(np.full(len(ears), face) for face, ears in made)]
        )
        places = np.concatenate([places[keep], *(ears for _, ears in made)])
        order = np.argsort(polygon, kind="stable")
        places, polygon = places[order], polygon[order]
    return Cut(places, polygon, crossed)


def area_vectors(mesh: MeshFile) -> Float[np.ndarray, "F 3"]:
    """Return twice the area of each polygon along its normal."""
    points = mesh.vertices[mesh.corners]
    return _newell(points - points[np.repeat(mesh.offsets[:-1], mesh.sizes)], mesh.offsets)


def _newell(
    local: Float[np.ndarray, "C 3"], offsets: Int[np.ndarray, " F1"]
) -> Float[np.ndarray, "F 3"]:
    """Return twice the area of each polygon along its normal, planar or not (Newell)."""
    return np.add.reduceat(cross(local, local[following(offsets)]), offsets[:-1], axis=0)


def _folded(
    local: Float[np.ndarray, "C 3"],
    places: Int[np.ndarray, "T 3"],
    normals: Float[np.ndarray, "T 3"],
) -> Bool[np.ndarray, " T"]:
    """Return which triangles have no area, or face away from their polygon."""
    a, b, c = (local[places[:, corner]] for corner in range(3))
    size = norm(normals)
    along = dot(cross(b - a, c - a), normals)
    folded: Bool[np.ndarray, " T"] = along <= ROUNDING * size**2
    return folded


def _in_plane(
    local: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "n 2"]:
    """Return a polygon's corners in two orthogonal directions of its plane, turning left."""
    length = np.linalg.norm(normal)
    unit = normal / length if length > 0 else np.array([0.0, 0.0, 1.0])
    first = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    first /= np.linalg.norm(first)
    return local @ np.stack([first, np.cross(unit, first)], axis=1)


def _by_ears(
    points: Float[np.ndarray, "n 2"], corners: Int[np.ndarray, " n"]
) -> Int[np.ndarray, "t 3"] | None:
    """Cut one polygon by ears; None where the area would be another, as where it meets itself."""
    area = _areas(points, np.array([[0, k, k + 1] for k in range(1, len(points) - 1)])).sum()
    if area == 0:
        return None
    tolerance = EXACT * abs(area)
    own = _without_spikes(points, np.flatnonzero(corners != np.roll(corners, 1)))
    for shift in range(ATTEMPTS if len(own) <= MANY else 1):
        order = np.roll(own, -shift)
        ears = _earcut(points[order])
        # Corners on its sides make no difference to a triangle's area.
        if ears is not None and abs(_areas(points, order[ears]).sum() - area) <= tolerance:
            triangles = _with_straight_corners(order[ears], points, order)
            areas = _areas(points, triangles)
            return np.where((areas < 0)[:, None], triangles[:, ::-1], triangles)
    return None


def _without_spikes(
    points: Float[np.ndarray, "n 2"], own: Int[np.ndarray, " m"]
) -> Int[np.ndarray, " k"]:
    """Return corners of a polygon but those where it turns back to the corner before."""
    places, ring = points.tolist(), list[int]()
    for corner in own.tolist():
        ring.append(corner)
        while len(ring) > 2 and places[ring[-1]] == places[ring[-3]]:
            del ring[-2:]
    # Where the outline begins the last corner, or the first, may be one.
    begin, end = 0, len(ring)
    while end - begin > 2 and places[ring[end - 2]] == places[ring[begin]]:
        end -= 2
    while end - begin > 2 and places[ring[end - 1]] == places[ring[begin + 1]]:
        begin, end = begin + 1, end - 1
    return np.array(ring[begin:end], dtype=np.int64)


def _earcut(points: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "t 3"] | None:
    import mapbox_earcut

    if len(points) < 3:
        return None
    ends = np.array([len(points)], dtype=np.uint32)
    ears = mapbox_earcut.triangulate_float64(np.ascontiguousarray(points), ends)
    return ears.reshape(-1, 3).astype(np.int64) if len(ears) else None


def _with_straight_corners(
    triangles: Int[np.ndarray, "t 3"],
    points: Float[np.ndarray, "n 2"],
    order: Int[np.ndarray, " m"],
) -> Int[np.ndarray, "u 3"]:
    """Cut triangles at the corners that lie on their sides, which cutting by ears leaves out."""
    used = set(triangles.reshape(-1).tolist())
    if len(used) == len(order):
        return triangles
    ring = order.tolist()
    begin = next(place for place, corner in enumerate(ring) if corner in used)
    between: dict[tuple[int, int], list[int]] = {}
    last, left = ring[begin], []
    for corner in [*ring[begin + 1 :], *ring[: begin + 1]]:
        if corner not in used:
            left.append(corner)
            continue
        if left:
            between[last, corner] = left
        last, left = corner, []
    made: list[list[int]] = []
    for triangle in triangles.tolist():
        outline: list[int] = []
        for corner, after in zip(triangle, [*triangle[1:], triangle[0]], strict=True):
            there, back = between.pop((corner, after), []), between.pop((after, corner), [])
            outline += [corner, *there, *reversed(back)]
        made += _fan_without_flat(outline, points)
    return np.array(made)


def _fan_without_flat(outline: list[int], points: Float[np.ndarray, "n 2"]) -> list[list[int]]:
    """Cut a triangle with more corners on its sides into triangles that have an area."""
    made: list[list[int]] = []
    ring = list(outline)
    while len(ring) > 3:
        corners = np.array(
            [[ring[k - 1], ring[k], ring[(k + 1) % len(ring)]] for k in range(len(ring))]
        )
        # The largest ear of a convex outline leaves the corners on its sides to the others.
        best = int(np.abs(_areas(points, corners)).argmax())
        made.append(corners[best].tolist())
        del ring[best]
    return [*made, ring]


def _areas(
    points: Float[np.ndarray, "n 2"], triangles: Int[np.ndarray, "t 3"]
) -> Float[np.ndarray, " t"]:
    """Return twice the signed areas of triangles."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    (x, y), (u, v) = (b - a).T, (c - a).T
    areas: Float[np.ndarray, " t"] = x * v - y * u
    return areas
