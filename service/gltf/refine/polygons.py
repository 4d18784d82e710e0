"""Polygons that triangles of a glTF came from: found, refined as such, written as triangles.

A glTF holds triangles. FB_ngon_encoding says which of them are one polygon: successive ones that
begin with one vertex. Elsewhere two triangles are one quad if they are nearly coplanar, agree in
all attributes along their edge, and make a convex quad; of several partners a triangle takes that
with the squarest quad, and then the nearest in the file.

Catmull–Clark's first level makes a quad of every corner of a polygon; in the end each quad is cut
into two triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pns_common.kernels.connectivity import pair_up
from pns_common.mesh.mesh import Cleaned, Mesh
from pns_common.mesh.rows import cross, distinct_rows, dot, norm, unit
from pns_common.mesh.topology import build_topology, following

from ...meshes.weld import canonical_zero
from ...options import PolygonRule
from ..read.primitives import TrianglePrimitive, distinct_corners
from .skin import read_skin_and_morph

# Authors' quads are rarely plane: at this angle between their triangles nearly all are found.
FLAT = np.cos(np.radians(8.0))
# Sine of a corner at which a quad is not convex any more.
STRAIGHT = 1e-3
# Steps of squareness between which the order of the file decides.
SQUARENESS = 1e-3


@dataclass(frozen=True, eq=False)
class Found:
    """Polygons of a primitive's triangles.

    Attributes:
        corners: (H,) corners 3 f + k of its triangles, polygon after polygon.
        offsets: (Q + 1,) where those of each polygon begin.
        alias: (3 F,) for each corner the one in `corners` at the same vertex of its polygon.
        polygon: (F,) the polygon of each triangle.
    """

    corners: Int[np.ndarray, " H"]
    offsets: Int[np.ndarray, " Q1"]
    alias: Int[np.ndarray, " C"]
    polygon: Int[np.ndarray, " F"]

    @property
    def joined(self) -> int:
        """Number of triangles that share their polygon."""
        return int((np.bincount(self.polygon)[self.polygon] > 1).sum())


def find_polygons(primitive: TrianglePrimitive, rule: PolygonRule) -> Found:
    """Return the polygons of a primitive's triangles, in the order of their first ones."""
    if rule == "auto" and primitive.ngons:
        return _encoded(primitive.corners)
    count = len(primitive.corners)
    pairs = _pairs(primitive) if rule == "auto" else np.zeros((0, 2), dtype=np.int64)
    alias, alone = np.arange(3 * count), np.ones(count, dtype=bool)
    there, back = pairs.T
    alias[_next(there)], alias[_next(back)] = back, there
    alone[pairs // 3] = False
    single = np.flatnonzero(alone)
    quads = np.stack([_before(there), there, _before(back), back], axis=1)
    first = np.concatenate([np.minimum(there, back) // 3, single])
    order = np.argsort(first)
    sizes = np.concatenate([np.full(len(quads), 4), np.full(len(single), 3)])
    rows = np.zeros((len(order), 4), dtype=np.int64)
    rows[: len(quads)] = quads
    rows[len(quads) :, :3] = 3 * single[:, None] + np.arange(3)
    sizes, rows = sizes[order], rows[order]
    corners = rows[np.arange(4) < sizes[:, None]]
    return _found(corners, sizes, alias, count)


def _found(
    corners: Int[np.ndarray, " H"],
    sizes: Int[np.ndarray, " Q"],
    alias: Int[np.ndarray, " C"],
    count: int,
) -> Found:
    polygon = np.empty(count, dtype=np.int64)
    polygon[corners // 3] = np.repeat(np.arange(len(sizes)), sizes)
    return Found(corners, np.append(0, np.cumsum(sizes)), alias, polygon)


def _encoded(faces: Int[np.ndarray, "F 3"]) -> Found:
    """Return the polygons that FB_ngon_encoding names: fans of successive triangles."""
    count = len(faces)
    opens = np.ones(count, dtype=bool)
    opens[1:] = (faces[1:, 0] != faces[:-1, 0]) | (faces[1:, 1] != faces[:-1, 2])
    alias = np.arange(3 * count).reshape(-1, 3)
    first = np.flatnonzero(opens)
    polygon = np.cumsum(opens) - 1
    alias[:, 0] = 3 * first[polygon]
    later = np.flatnonzero(~opens)
    alias[later, 1] = 3 * (later - 1) + 2
    alias = alias.reshape(-1)
    corners = np.flatnonzero(alias == np.arange(3 * count))
    sizes = np.bincount(polygon[corners // 3], minlength=len(first))
    return Found(corners, np.append(0, np.cumsum(sizes)), alias, polygon)


def _pairs(primitive: TrianglePrimitive) -> Int[np.ndarray, "N 2"]:
    """Return the edges between triangles of one quad, by their corners in both triangles."""
    positions = primitive.attributes["POSITION"]
    movement = read_skin_and_morph([primitive]).labels
    labels = distinct_rows(canonical_zero(positions))
    if movement is not None:
        labels = distinct_rows(np.stack([labels, movement], axis=1))
    faces, row = distinct_corners(primitive, primitive.corners, labels)
    points = positions[row].astype(np.float64)
    mesh = build_topology(faces, len(row))
    there, back = mesh.half_edges[mesh.interior].astype(np.int64).T
    flat = faces.reshape(-1)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    normals = unit(cross(b - a, c - a))
    plane = dot(normals[there // 3], normals[back // 3]) > FLAT
    there, back = there[plane], back[plane]
    ring = flat[np.stack([_before(there), there, _before(back), back], axis=1)]
    corner = points[ring]
    sides = np.roll(corner, -1, axis=1) - corner
    lengths = norm(sides.reshape(-1, 3)).reshape(-1, 4, 1)
    sides = np.divide(sides, lengths, out=np.zeros_like(sides), where=lengths > 0)
    before = np.roll(sides, 1, axis=1)
    up = unit(normals[there // 3] + normals[back // 3])
    turn = cross(before.reshape(-1, 3), sides.reshape(-1, 3)).reshape(-1, 4, 3)
    sine = (turn * up[:, None]).sum(axis=2)
    skew = np.abs((before * sides).sum(axis=2)).max(axis=1)
    convex = (sine > STRAIGHT).all(axis=1) & (ring[:, 0] != ring[:, 2])
    there, back, skew = there[convex], back[convex], np.rint(skew[convex] / SQUARENESS)
    first, second = np.minimum(there, back) // 3, np.maximum(there, back) // 3
    order = np.lexsort((first, second - first, skew))
    chosen = np.zeros(len(order), dtype=bool)
    free = np.ones(len(faces), dtype=bool)
    pair_up(first[order], second[order], free, chosen)
    return np.stack([there, back], axis=1)[order[chosen]]


def _next(corner: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    return np.where(corner % 3 < 2, corner + 1, corner - 2)


def _before(corner: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    return np.where(corner % 3 > 0, corner - 1, corner + 2)


@dataclass(frozen=True, eq=False)
class KeptFaces:
    """The faces that a control mesh's kept triangles are or form, primitive after primitive.

    Attributes:
        surface: the faces to refine, each once.
        corners: (H,) corners 3 f + k of the kept triangles, face after face, copies among them.
        offsets: (Q + 1,) where those of each face begin.
        source: (H,) the corner of `surface` at the same vertex of the same face.
        turned: (Q,) whether a copy runs the other way round.
        of_kept: (P,) the face of `surface` that each kept triangle is part of.
    """

    surface: Mesh
    corners: Int[np.ndarray, " H"]
    offsets: Int[np.ndarray, " Q1"]
    source: Int[np.ndarray, " H"]
    turned: Bool[np.ndarray, " Q"]
    of_kept: Int[np.ndarray, " P"]


def triangles_of(welded: Int[np.ndarray, "F 3"], cleaned: Cleaned) -> KeptFaces:
    """Return triangles over welded vertices that have three different ones, copies among them."""
    proper = cleaned.representative >= 0
    leader = cleaned.representative[proper]
    order = np.tile(np.arange(3), (len(leader), 1))
    copies = np.flatnonzero(cleaned.face_map[proper] < 0)
    if len(copies):
        own, faces = cleaned.vertex_map[welded[proper][copies]], cleaned.mesh.faces[leader[copies]]
        order[copies] = (own[:, :, None] == faces[:, None, :]).argmax(axis=2)
    return KeptFaces(
        surface=cleaned.mesh,
        corners=np.arange(order.size),
        offsets=np.arange(0, order.size + 1, 3),
        source=(3 * leader[:, None] + order).reshape(-1),
        turned=(order[:, 1] - order[:, 0]) % 3 == 2,
        of_kept=leader,
    )


def polygons_of(
    mesh: Mesh,
    faces: Int[np.ndarray, "P 3"],
    found: Sequence[Found],
    kept: Sequence[Bool[np.ndarray, " F"]],
) -> KeptFaces:
    """Return the polygons of kept triangles `faces`, copies among them, over a mesh's vertices.

    Polygons fall apart into triangles where welding parts their corners or joins two of them, where
    a triangle of them was dropped, and where a copy of a triangle is part of another polygon.
    """
    flat = faces.reshape(-1)
    alias, corners, sizes, group = _of_kept(found, kept)
    whole = np.ones(len(sizes), dtype=bool)
    whole[np.repeat(np.arange(len(sizes)), sizes)[corners < 0]] = False
    lost = (alias < 0) | (flat[alias] != flat)
    whole[np.repeat(group, 3)[lost]] = False
    triangle = distinct_rows(np.sort(faces, axis=1))
    while True:
        own = _divided(corners, sizes, group, whole)
        polygon = np.empty(len(faces), dtype=np.int64)
        polygon[own.corners // 3] = own.of_corner
        leader = _leaders(triangle, polygon, len(own.offsets) - 1)
        source, turned, fits = own.matched(flat, leader)
        if fits.all():
            break
        whole[group[~fits[polygon]]] = False
        # Copies follow what they are copies of.
        spoilt = np.zeros(len(faces), dtype=bool)
        spoilt[triangle[~whole[group]]] = True
        whole[group[spoilt[triangle]]] = False
    is_leader = leader == np.arange(len(leader))
    number = np.cumsum(is_leader) - 1
    places = own.corners[is_leader[own.of_corner]]
    first = np.cumsum(is_leader[own.of_corner]) - 1
    offsets = np.append(0, np.cumsum(np.diff(own.offsets)[is_leader]))
    return KeptFaces(
        surface=Mesh(mesh.vertices, (flat[places], offsets)),
        corners=own.corners,
        offsets=own.offsets,
        source=first[source],
        turned=turned,
        of_kept=number[leader[polygon]],
    )


@dataclass(frozen=True, eq=False)
class _Rings:
    """The corners of Q polygons, one after the other."""

    corners: Int[np.ndarray, " H"]
    offsets: Int[np.ndarray, " Q1"]

    @property
    def of_corner(self) -> Int[np.ndarray, " H"]:
        """The polygon of each corner."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    def matched(
        self, vertices: Int[np.ndarray, " C"], leader: Int[np.ndarray, " Q"]
    ) -> tuple[Int[np.ndarray, " H"], Bool[np.ndarray, " Q"], Bool[np.ndarray, " Q"]]:
        """Return the corner of its leader at each corner's vertex, and who is turned, and who fits.

        A polygon fits that has distinct vertices, and those of its leader in their order or turned.
        """
        vertex, polygon = vertices[self.corners], self.of_corner
        count = int(vertex.max(initial=0)) + 1
        keys = polygon * count + vertex
        order = np.argsort(keys, kind="stable")
        ordered = keys[order]
        asked = leader[polygon] * count + vertex
        source = order[np.minimum(np.searchsorted(ordered, asked), len(order) - 1)]
        wrong = keys[source] != asked
        wrong[order[1:]] |= ordered[1:] == ordered[:-1]
        sizes = np.diff(self.offsets)
        wrong |= (sizes != sizes[leader])[polygon]
        follow = following(self.offsets)
        onward, back = follow[source] == source[follow], source == follow[source[follow]]
        turned = back[self.offsets[:-1]] & ~onward[self.offsets[:-1]]
        wrong |= ~np.where(turned[polygon], back, onward)
        fits = np.ones(len(sizes), dtype=bool)
        fits[polygon[wrong]] = False
        return source, turned, fits


def _of_kept(
    found: Sequence[Found], kept: Sequence[Bool[np.ndarray, " F"]]
) -> tuple[
    Int[np.ndarray, " C"], Int[np.ndarray, " H"], Int[np.ndarray, " Q"], Int[np.ndarray, " P"]
]:
    """Return alias and corners by the numbers of kept triangles, −1 where lost; sizes; polygons."""
    keep = np.concatenate(kept)
    number = np.where(keep, np.cumsum(keep) - 1, -1)
    aliases, corners, groups, first, start = [], [], [], 0, 0
    for own in found:
        aliases.append(own.alias + start)
        corners.append(own.corners + start)
        groups.append(own.polygon + first)
        first, start = first + len(own.offsets) - 1, start + len(own.alias)
    group = np.concatenate(groups)

    def renumbered(corner: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
        of_face = number[corner // 3]
        return np.where(of_face < 0, -1, 3 * of_face + corner % 3)

    alias = renumbered(np.concatenate(aliases))[np.repeat(keep, 3)]
    sizes = np.concatenate([np.diff(own.offsets) for own in found])
    return alias, renumbered(np.concatenate(corners)), sizes, group[keep]


def _divided(
    corners: Int[np.ndarray, " H"],
    sizes: Int[np.ndarray, " Q"],
    group: Int[np.ndarray, " P"],
    whole: Bool[np.ndarray, " Q"],
) -> _Rings:
    """Return the whole polygons and the triangles of others, in the order of first triangles."""
    single = np.flatnonzero(~whole[group])
    stays = np.repeat(whole, sizes)
    owner = np.repeat(np.cumsum(whole) - 1, sizes)[stays]
    first = np.full(int(whole.sum()), len(group))
    np.minimum.at(first, owner, corners[stays] // 3)
    of_corner = np.concatenate([first[owner], np.repeat(single, 3)])
    every = np.concatenate([corners[stays], (3 * single[:, None] + np.arange(3)).reshape(-1)])
    order = np.argsort(of_corner, kind="stable")
    of_corner = of_corner[order]
    starts = np.flatnonzero(np.diff(of_corner, prepend=-1))
    return _Rings(every[order], np.append(starts, len(order)))


def _leaders(
    triangle: Int[np.ndarray, " P"], polygon: Int[np.ndarray, " P"], count: int
) -> Int[np.ndarray, " Q"]:
    """Return for each polygon the first one that has a copy of one of its triangles."""
    first = np.full(len(triangle), count)
    np.minimum.at(first, triangle, polygon)
    leader = np.full(count, count)
    np.minimum.at(leader, polygon, first[triangle])
    return leader
