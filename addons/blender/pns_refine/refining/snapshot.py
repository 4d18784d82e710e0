"""Arrays of a mesh before and after it is refined, without Blender."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import Mesh


class Domain(Enum):
    """Elements that a layer's rows belong to."""

    POINT = "POINT"
    EDGE = "EDGE"
    FACE = "FACE"
    CORNER = "CORNER"


class Rule(Enum):
    """Rule by which a new row comes of old ones."""

    # Weighted by the scheme's masks.
    BLEND = "blend"
    # One of the parents' values: that of most, as numbers that only name something must not mix.
    VOTE = "vote"
    # An old element's value for what is left of it, and zero for what is new.
    KEEP = "keep"


class Smoothing(Enum):
    """Values of corners that stay, by the names of Blender's Subdivision Surface for UV maps."""

    NONE = "NONE"
    PRESERVE_CORNERS = "PRESERVE_CORNERS"
    PRESERVE_BOUNDARIES = "PRESERVE_BOUNDARIES"
    SMOOTH_ALL = "SMOOTH_ALL"


@dataclass(frozen=True, eq=False)
class Layer:
    """One attribute: ``values`` (N, K), a row for each element of the domain.

    ``kind`` is Blender's type of it. ``names`` are the texts that values are places in, where the
    attribute is text. ``unit`` says that rows are directions or rotations, kept at length 1.
    """

    name: str
    kind: str
    domain: Domain
    rule: Rule
    values: np.ndarray
    names: tuple[Any, ...] = ()
    unit: bool = False

    def of(self, values: np.ndarray) -> Layer:
        """Return the same attribute with other rows."""
        return replace(self, values=values)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A mesh as it was read, with the triangles that its polygons can be cut into.

    Attributes:
        points: positions of V vertices.
        triangles: (T, 3) vertices.
        corners: (T, 3) the mesh's own corners that triangles have theirs from.
        polygons: (T,) the polygon that a triangle is part of.
        polygon_corners: (P + 1,) where each polygon's corners begin.
        edges: (E, 2) vertices of the mesh's own edges.
        crease_sharpness: (E,) how many levels an edge stays sharp; infinity for a crease for good.
        vertex_sharpness: (V,) of vertices.
        groups: (V, G) weights of the vertex groups.
        offsets: (K, V, 3) how far each shape key moves the vertices.
        layers: all attributes.
    """

    points: Float[np.ndarray, "V 3"]
    triangles: Int[np.ndarray, "T 3"]
    corners: Int[np.ndarray, "T 3"]
    polygons: Int[np.ndarray, " T"]
    polygon_corners: Int[np.ndarray, " P+1"]
    edges: Int[np.ndarray, "E 2"]
    crease_sharpness: Float[np.ndarray, " E"]
    vertex_sharpness: Float[np.ndarray, " V"]
    groups: Float[np.ndarray, "V G"]
    offsets: Float[np.ndarray, "K V 3"]
    layers: tuple[Layer, ...]

    @cached_property
    def edge_used(self) -> Bool[np.ndarray, " E"]:
        """True for edges that belong to a face."""
        sides = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=-1)
        return np.isin(edge_keys(self.edges), edge_keys(sides.reshape(-1, 2)))

    @property
    def has_polygons(self) -> bool:
        """Tell whether a face has more than three corners."""
        return len(self.triangles) != len(self.polygon_corners) - 1

    def control(self, *, whole: bool) -> Control:
        """Return the polygons, ``whole`` or cut into triangles.

        Raises:
            MeshError: the mesh cannot be refined.
        """
        if not whole:
            triangles = Mesh(self.points, self.triangles)
            return Control(triangles, self.corners.reshape(-1), self.polygons)
        count = self.polygon_corners[-1]
        vertices = np.empty(count, dtype=np.int64)
        vertices[self.corners] = self.triangles
        polygons = Mesh(self.points, (vertices, self.polygon_corners))
        return Control(polygons, np.arange(count), np.arange(len(self.polygon_corners) - 1))


@dataclass(frozen=True, eq=False)
class Control:
    """The mesh to refine, the snapshot's corner of each corner, and its polygon of each face."""

    mesh: Mesh
    corners: Int[np.ndarray, " H"]
    polygons: Int[np.ndarray, " F"]


@dataclass(frozen=True, eq=False)
class Faces:
    """The faces of a result as Blender holds them.

    ``starts`` (F + 1) says where each face's corners begin; ``vertices`` and ``edges`` are those of
    the corners (an edge runs from its corner to the next); ``parents`` are the old polygons.
    """

    starts: Int[np.ndarray, " F+1"]
    vertices: Int[np.ndarray, " C"]
    edges: Int[np.ndarray, " C"]
    parents: Int[np.ndarray, " F"]


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined snapshot: the same arrays at the new vertices, edges, faces and corners.

    ``ratio`` and ``gate`` are the operator's diagnostics, ``distance`` is how far each vertex lies
    from where the base scheme alone would have it. ``normals`` are the surface's own, where they
    are known.
    ``split_vertices`` counts old vertices of faces' borders that share their place with another.
    """

    points: Float[np.ndarray, "W 3"]
    faces: Faces
    edges: Int[np.ndarray, "E 2"]
    crease_sharpness: Float[np.ndarray, " E"]
    vertex_sharpness: Float[np.ndarray, " W"]
    groups: Float[np.ndarray, "W G"]
    offsets: Float[np.ndarray, "K W 3"]
    layers: tuple[Layer, ...]
    ratio: Float[np.ndarray, " W"]
    gate: Float[np.ndarray, " W"]
    distance: Float[np.ndarray, " W"]
    normals: Float[np.ndarray, "W 3"] | None
    report: dict[str, Any]
    split_vertices: int


def edge_keys(pairs: Int[np.ndarray, "N 2"]) -> Int[np.ndarray, " N"]:
    """Return one number for each pair of vertices, whichever comes first."""
    pairs = np.asarray(pairs, dtype=np.int64)
    return pairs.min(axis=1, initial=2**31) << np.int64(32) | pairs.max(axis=1, initial=0)
