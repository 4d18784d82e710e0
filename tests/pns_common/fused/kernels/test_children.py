"""The children of faces and edges by arithmetic, against the split mesh itself."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology, split
from pns_common.fused.kernels.children import (
    number_halves,
    split_edges,
    split_faces,
    split_faces_long,
)
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bent, bumpy_sphere, grid, three_pages

SHAPES = {"closed": bumpy_sphere(0, 0), "open": grid(3, bent), "pages": three_pages()}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("shape", SHAPES)
def test_children_are_those_of_the_split_mesh(shape, way):
    points, faces = SHAPES[shape]
    parent, topology = edges_built(Mesh(points, faces)), build_topology(faces, len(points))
    children = split(topology)
    child = build_topology(children, len(points) + len(topology.edges))
    for dtype, kernel in ((np.int32, split_faces), (np.int64, split_faces_long)):
        made = np.empty((4 * len(faces), 3), dtype=dtype)
        WAYS[way](kernel)(parent.faces, parent.face_edges, len(points), 0, len(faces), made)
        np.testing.assert_array_equal(made, children)

    halves = np.empty((len(topology.edges), 2), dtype=np.int32)
    edges = parent.faces, parent.face_edges, parent.edges, parent.half_edges
    WAYS[way](number_halves)(*edges, 0, len(faces), halves)
    number = {tuple(edge): e for e, edge in enumerate(child.edges.tolist())}
    for e, ends in enumerate(topology.edges.tolist()):
        assert halves[e].tolist() == [number[end, len(points) + e] for end in ends]

    to_edges, to_halves = (np.empty((len(child.edges), 2), dtype=np.int32) for _ in range(2))
    to_faces = np.empty((4 * len(faces), 3), dtype=np.int32)
    to_class = np.empty(len(child.edges), dtype=np.int8)
    WAYS[way](split_edges)(
        *(parent.faces, parent.face_edges, parent.half_edges, parent.edge_class, halves),
        *(len(points), 0, len(faces), to_faces, to_edges, to_halves, to_class),
    )
    np.testing.assert_array_equal(to_edges, child.edges)
    np.testing.assert_array_equal(to_faces, child.face_edges)
    np.testing.assert_array_equal(to_class, child.edge_class)
    np.testing.assert_array_equal(to_halves[child.interior], child.half_edges[child.interior])
