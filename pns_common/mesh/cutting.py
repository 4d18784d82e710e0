"""Cut polygons in the plane of each: into triangles, or where they are concave into convex pieces.

Triangles are cut off by ears (mapbox-earcut). Every corner stays a corner, those on a straight side
too: a neighbour may end there.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.mesh.mesh import Mesh, check_is_mesh, fans
from pns_common.mesh.rows import cross, dot, norm
from pns_common.mesh.topology import following

# Polygons that are cut together.
BLOCK = 2**14
# Of the polygon's area, or of the square of its size: what rounding leaves of nothing.
ROUNDING = 1e-12
# How much of its area cutting may gain or lose before it is tried from another corner.
EXACT = 1e-9
ATTEMPTS = 4
# Polygons of more corners are tried once: what crosses itself is no better from elsewhere.
MANY = 64


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
    normals = newell(local, offsets)
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


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polygons of which the concave ones are cut.

    Attributes:
        places: (H,) which corner of the polygons each corner is.
        offsets: (F + 1,) where the corners of each piece begin; the last is their number.
        face: (F,) the polygon that each is of.
        cut: how many were cut.
        crossed: how many were left as they are, since they cross themselves or have no area.
    """

    places: Int[np.ndarray, " H"]
    offsets: Int[np.ndarray, " F1"]
    face: Int[np.ndarray, " F"]
    cut: int
    crossed: int


def cut_concave(mesh: Mesh) -> Mesh:
    """Cut faces that do not see all their sides from their centre into convex pieces.

    Catmull–Clark puts a vertex at the mean of a face's corners and joins it to the middles of the
    sides: that tiles a face which is star-shaped from there, and overlaps elsewhere. Faces keep
    their order, the pieces of one come one after another, and no vertex is added. Faces that cross
    themselves or have no area stay. ``convex_pieces`` also says which corner went where.

    Raises:
        ParameterError: it is no Mesh.
        ImportError: a polygon is to be cut, and mapbox_earcut is not installed.

    Example:
        >>> arrow = Mesh([[0, 0, 0], [4, -1, 0], [1, 0, 0], [4, 1, 0]], [[0, 1, 2, 3]])
        >>> cut_concave(arrow).face_count
        2
    """
    check_is_mesh(mesh)
    pieces = convex_pieces(mesh.vertices, mesh.offsets, mesh.corners)
    if not pieces.cut:
        return mesh
    return Mesh(mesh.vertices, (mesh.corners[pieces.places], pieces.offsets))


def convex_pieces(
    vertices: Float[np.ndarray, "V 3"],
    offsets: Int[np.ndarray, " F1"],
    corners: Int[np.ndarray, " C"],
) -> Pieces:
    """Cut polygons that are not star-shaped from their centre into convex pieces."""
    sizes, crossed, made = np.diff(offsets), 0, dict[int, list[list[int]]]()
    # Areas of coordinates near the largest numbers may be infinite: such polygons stay.
    with np.errstate(over="ignore", invalid="ignore"):
        for f in np.flatnonzero(~are_star_shaped(vertices, offsets, corners)).tolist():
            own = corners[offsets[f] : offsets[f + 1]]
            cut = cut_polygons(vertices, np.array([0, len(own)]), own)
            if cut.crossed:
                crossed += 1
                continue
            local = vertices[own] - vertices[own[0]]
            flat = _in_plane(local, newell(local, np.array([0, len(own)]))[0])
            rings = _merged(cut.places.tolist(), flat)
            made[f] = [[int(offsets[f]) + k for k in ring] for ring in rings]
    if not made:
        return Pieces(np.arange(len(corners)), offsets, np.arange(len(sizes)), 0, crossed)
    rows = [
        (f, ring)
        for f in range(len(sizes))
        for ring in made.get(f, [range(offsets[f], offsets[f + 1])])
    ]
    ends = np.cumsum([0, *(len(ring) for _, ring in rows)])
    places = np.concatenate([np.asarray(ring) for _, ring in rows])
    return Pieces(places, ends, np.array([f for f, _ in rows]), len(made), crossed)


def are_star_shaped(
    vertices: Float[np.ndarray, "V 3"],
    offsets: Int[np.ndarray, " F1"],
    corners: Int[np.ndarray, " C"],
) -> Bool[np.ndarray, " F"]:
    """Return which polygons see all their sides from the mean of their corners.

    Triangles do; polygons without an area count as such, since no cut mends them.
    """
    sizes = np.diff(offsets)
    of_corner, points = np.repeat(np.arange(len(sizes)), sizes), vertices[corners]
    centre = np.add.reduceat(points, offsets[:-1], axis=0) / sizes[:, None]
    local = points - centre[of_corner]
    after = local[following(offsets)]
    normals = newell(local, offsets)
    area = dot(normals, normals)[of_corner]
    along = dot(cross(local, after), normals[of_corner])
    seen = (along > ROUNDING * area) | (area == 0) | ~(local != after).any(axis=1)
    return np.logical_and.reduceat(seen, offsets[:-1]) | (sizes == 3)


def _merged(triangles: list[list[int]], points: Float[np.ndarray, "n 2"]) -> list[list[int]]:
    """Join triangles across their sides, the longest first, as long as pieces stay convex.

    Hertel and Mehlhorn 1983: at most four times as many pieces as the fewest. Pieces are rings of
    linked sides, of which side k starts at ``origin[k]``: joining two takes O(1).
    """
    xy = points.tolist()
    origin = [corner for triangle in triangles for corner in triangle]
    after = [k + 1 - 3 * (k % 3 == 2) for k in range(len(origin))]
    before = [k - 1 + 3 * (k % 3 == 0) for k in range(len(origin))]
    side_at = {(origin[k], origin[after[k]]): k for k in range(len(origin))}
    # Of each triangle the piece that it is in, or one on the way there; of each piece a side.
    piece = list(range(len(triangles)))
    first = [3 * t for t in piece]

    def turns_left(a: int, b: int, c: int) -> bool:
        (x, y), (u, v) = ((xy[k][0] - xy[b][0], xy[k][1] - xy[b][1]) for k in (a, c))
        return u * y - v * x >= 0

    def piece_of(side: int) -> int:
        t = side // 3
        while piece[t] != t:
            piece[t] = piece[piece[t]]
            t = piece[t]
        return t

    shared = [(a, b) for a, b in side_at if a < b and (b, a) in side_at]
    shared.sort(key=lambda side: (-np.hypot(*(points[side[0]] - points[side[1]])), side))
    for a, b in shared:
        left, right = side_at[a, b], side_at[b, a]
        at_a, at_b = (before[left], after[right]), (before[right], after[left])
        if all(
            turns_left(origin[come], corner, origin[after[go]])
            for corner, (come, go) in ((a, at_a), (b, at_b))
        ):
            for come, go in (at_a, at_b):
                after[come], before[go] = go, come
            kept = piece_of(left)
            piece[piece_of(right)] = kept
            first[kept] = at_b[1]
    rings = list[list[int]]()
    for t in range(len(triangles)):
        if piece[t] == t:
            ring, side = [origin[first[t]]], after[first[t]]
            while side != first[t]:
                ring.append(origin[side])
                side = after[side]
            rings.append(ring)
    return rings


def newell(
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
    try:
        import mapbox_earcut
    except ImportError as error:
        advice = "pip install 'pns-subdivision[polygons]'"
        raise ImportError(f"cutting concave polygons needs mapbox_earcut: {advice}") from error
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
    last, left = ring[begin], list[int]()
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
    """Cut a triangle with more corners on its sides into triangles that have an area.

    The largest ear of a convex outline leaves the corners on its sides to the others. Ears are
    kept in a heap: O(n log n).
    """
    count = len(outline)
    before, after = [k - 1 for k in range(count)], [k + 1 for k in range(count)]
    before[0], after[-1] = count - 1, 0
    version = [0] * count
    places = [points[corner].tolist() for corner in outline]

    def ear(k: int) -> tuple[float, int, int]:
        (a, b), (c, d), (e, f) = places[before[k]], places[k], places[after[k]]
        return -abs((c - a) * (f - b) - (e - a) * (d - b)), k, version[k]

    ears = [ear(k) for k in range(count)]
    heapify(ears)
    made: list[list[int]] = []
    last = 0
    while count > 3:
        _, k, seen = heappop(ears)
        if seen != version[k]:
            continue
        left, right = before[k], after[k]
        made.append([outline[left], outline[k], outline[right]])
        version[k] += 1
        after[left], before[right] = right, left
        for neighbour in (left, right):
            version[neighbour] += 1
            heappush(ears, ear(neighbour))
        last, count = left, count - 1
    rest = sorted((before[last], last, after[last]))
    return [*made, [outline[k] for k in rest]]


def _areas(
    points: Float[np.ndarray, "n 2"], triangles: Int[np.ndarray, "t 3"]
) -> Float[np.ndarray, " t"]:
    """Return twice the signed areas of triangles."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    (x, y), (u, v) = (b - a).T, (c - a).T
    areas: Float[np.ndarray, " t"] = x * v - y * u
    return areas
