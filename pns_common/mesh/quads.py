"""The split of polygons into quads, one for each corner.

The vertex of edge e is V + e, that of face f is V + E + f; old vertices keep their numbers. The
quad of corner h is (its vertex, the vertex of the edge that leaves it, the face's vertex, that of
the edge that enters it), and it is face h of the refined mesh.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Integer

from pns_common.kernels import quads as kernels
from pns_common.mesh.topology import NO_WEIGHTS, Topology, build_topology, inheriting
from pns_common.parallel import Blocks

QUAD = kernels.QUAD


def quad_faces(
    parent: Topology, blocks: Blocks, dtype: type[np.uint32] | type[np.int64] = np.uint32
) -> Integer[np.ndarray, "H 4"]:
    """Return the quads of the split of a mesh of any polygons."""
    faces = np.empty((len(parent.corners), QUAD), dtype=dtype)
    count = parent.vertex_count
    read = parent.corners, parent.offsets, parent.corner_edges, count, count + len(parent.edges)
    blocks.run(parent.face_count, lambda begin, end: kernels.split_faces(*read, begin, end, faces))
    return faces


def split_quads(parent: Topology, blocks: Blocks, *, inherit: bool = True) -> Topology:
    """Return the topology of the split; ``inherit``: whether halves of edges stay sharp."""
    corners = quad_faces(parent, blocks).reshape(-1)
    faces, edge_count = len(parent.corners), len(parent.edges)
    vertex_count = parent.vertex_count + edge_count + parent.face_count
    offsets = np.arange(0, len(corners) + 1, QUAD, dtype=np.int32)
    worn = parent.worn_vertices(vertex_count)
    soft_corners = parent.soft_corners_of_split(vertex_count, inherit=inherit)
    if not parent.plain:
        made = build_topology((corners, offsets), vertex_count, blocks)
        made = replace(made, vertex_sharpness=worn, soft_corners=soft_corners)
        return (inheriting(made, parent) if inherit else made).worn(parent, inherit=inherit)
    source = parent if inherit else parent.without_creases()
    halves, arrays = np.empty((edge_count, 2), np.uint32), (parent.corners, parent.offsets)
    blocks.run(
        parent.face_count,
        lambda begin, end: kernels.number_halves(
            *arrays, parent.corner_edges, parent.edges, parent.half_edges, begin, end, halves
        ),
    )
    count = 2 * edge_count + faces
    edges, half_edges = np.empty((count, 2), np.uint32), np.empty((count, 2), np.int32)
    edge_class, corner_edges = np.empty(count, np.int8), np.empty((faces, QUAD), np.uint32)
    of_edges = parent.corner_edges, parent.half_edges, source.edge_class, parent.edges, halves
    read = *arrays, parent.face_of_corner, *of_edges, parent.vertex_count
    to = corner_edges, edges, half_edges, edge_class
    blocks.run(parent.face_count, lambda begin, end: kernels.split_edges(*read, begin, end, *to))
    soft = NO_WEIGHTS
    if inherit and len(parent.soft):
        soft = np.zeros(count)
        soft[halves] = parent.soft[:, None]
    made = Topology(
        vertex_count,
        corners,
        offsets,
        np.repeat(np.arange(faces, dtype=np.uint32), QUAD),
        edges,
        corner_edges.reshape(-1),
        half_edges,
        edge_class,
        soft,
        worn,
        plain=True,
        soft_corners=soft_corners,
    )
    return made.worn(parent, halves, inherit=inherit)
