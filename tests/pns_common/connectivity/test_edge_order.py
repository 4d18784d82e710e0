"""Which vertex is a and which is c, on two triangles, by hand."""

import numpy as np
import pytest

from pns_common.connectivity.edge_order import first_face_order, left_face_order
from pns_common.connectivity.topology import build_topology


@pytest.mark.parametrize(
    ("faces", "first", "left"),
    [
        # c lies in the face of lower index; to the left of 0 → 1 runs the face (0, 1, 2).
        ([[0, 1, 2], [1, 0, 3]], [0, 1, 2, 3], [0, 1, 2, 3]),
        ([[1, 0, 3], [0, 1, 2]], [0, 1, 3, 2], [0, 1, 2, 3]),
        ([[3, 1, 0], [2, 0, 1]], [0, 1, 3, 2], [0, 1, 2, 3]),
    ],
)
def test_c_lies_in_the_first_face_or_to_the_left(faces, first, left):
    topology = build_topology(np.array(faces), 4)
    for order, expected in ((first_face_order, first), (left_face_order, left)):
        edges = order(topology, topology.interior)
        assert edges.stencil.tolist() == [expected]
        for vertex, face in zip(edges.stencil[0, 2:], edges.faces[0], strict=True):
            assert vertex in faces[face]
