"""Arrays of a mesh before and after it is refined, without Blender."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import Mesh
from pns_common.carry.carried import Column
from pns_common.mesh.topology import Topology

Domain = Literal["POINT", "EDGE", "FACE", "CORNER"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Layer(Column):
    """An attribute: a column of the library's, with a row for each element of the domain.

    ``kind`` is Blender's type of it. ``texts`` are what values are places in, where it is text.
    At edges and faces old ones give their values to their parts, and what is new has zeros.
    """

    name: str
    kind: str
    domain: Domain
    texts: tuple[Any, ...] = ()


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

    def marked(self, name: str, domain: Domain) -> Bool[np.ndarray, " N"]:
        """Return where a switch of this name is on; nowhere, where there is none."""
        for layer in self.layers:
            if (layer.name, layer.domain) == (name, domain):
                return layer.values[:, 0].astype(bool)
        counts = {"EDGE": len(self.edges), "FACE": len(self.polygon_corners) - 1}
        return np.zeros(counts[domain], dtype=bool)

    def control(self, *, whole: bool) -> Control:
        """Return the polygons, ``whole`` or cut into triangles.

        Raises:
            MeshError: the mesh cannot be refined.
        """
        if not whole:
            triangles = Mesh(self.points, self.triangles)
            return Control(triangles, self.corners.reshape(-1), self.polygons, self.edges)
        count = self.polygon_corners[-1]
        vertices = np.empty(count, dtype=np.int64)
        vertices[self.corners] = self.triangles
        polygons = Mesh(self.points, (vertices, self.polygon_corners))
        faces = np.arange(len(self.polygon_corners) - 1)
        return Control(polygons, np.arange(count), faces, self.edges)


@dataclass(frozen=True, eq=False)
class Control:
    """The mesh to refine; the snapshot's corner of each corner, polygon of each face, and edges."""

    mesh: Mesh
    corners: Int[np.ndarray, " H"]
    polygons: Int[np.ndarray, " F"]
    edges: Int[np.ndarray, "E 2"]

    @cached_property
    def topology(self) -> Topology:
        """The connectivity of the mesh."""
        return self.mesh.topology()

    @cached_property
    def there(self) -> Bool[np.ndarray, " E"]:
        """True for edges of the snapshot that are edges of the mesh."""
        return np.isin(edge_keys(self.edges), edge_keys(self.topology.edges))

    @cached_property
    def own_edge(self) -> Int[np.ndarray, " G"]:
        """The snapshot's edge of each edge of the mesh; −1 for diagonals that cut polygons."""
        own = np.full(len(self.topology.edges), -1, dtype=np.int64)
        own[self.topology.rows_of(self.edges[self.there])] = np.flatnonzero(self.there)
        return own


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined snapshot: the same arrays at the new vertices, edges, faces and corners.

    Attributes:
        topology: the faces, with their edges.
        polygons: the old polygon that each face is part of.
        edges: those of the faces, then those without.
        ratio, gate: the operator's diagnostics.
        distance: how far each vertex lies from where the base scheme alone would have it.
        report: the library's.
        split_vertices: how many old vertices of borders share their place with another.
    """

    points: Float[np.ndarray, "W 3"]
    topology: Topology
    polygons: Int[np.ndarray, " F"]
    edges: Int[np.ndarray, "E 2"]
    crease_sharpness: Float[np.ndarray, " E"]
    vertex_sharpness: Float[np.ndarray, " W"]
    groups: Float[np.ndarray, "W G"]
    offsets: Float[np.ndarray, "K W 3"]
    layers: tuple[Layer, ...]
    ratio: Float[np.ndarray, " W"]
    gate: Float[np.ndarray, " W"]
    distance: Float[np.ndarray, " W"]
    report: dict[str, Any]
    split_vertices: int


def edge_keys(pairs: Int[np.ndarray, "N 2"]) -> Int[np.ndarray, " N"]:
    """Return one number for each pair of vertices, whichever comes first."""
    pairs = np.asarray(pairs, dtype=np.int64)
    return pairs.min(axis=1, initial=2**31) << np.int64(32) | pairs.max(axis=1, initial=0)
