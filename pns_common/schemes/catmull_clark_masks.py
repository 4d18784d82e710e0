"""Catmull–Clark subdivision of polygons (Catmull and Clark 1978), with sharp and soft creases.

    face vertex          the mean of the face's corners
    edge vertex          (a + b + both face vertices) / 4
    vertex vertex        (k − 2)/k p + 1/k² Σ neighbours + 1/k² Σ face vertices
    sharp edge           the midpoint
    on a sharp curve     3/4 p + 1/8 (the two neighbours along it)
    corner               p

Sharp and soft edges are as in Loop's scheme (``schemes.loop``). k is the number of a vertex's
corners, and each corner brings half of both neighbours along its face: in a closed fan every
neighbour counts once. A vertex of a single corner and no curve stays.

Every face of n corners becomes n quads, so all faces are quads from the first level on.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.kernels import catmull_clark as kernels
from pns_common.kernels.loop import MIDPOINT
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import CURVE, WIDTH, follow_curves, in_threes


def place(
    values: Float[np.ndarray, "V K"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W K"]:
    """Apply the masks to any columns: rows of old vertices, then of edges, then of faces."""
    rows = topology.vertex_count + len(topology.edges) + topology.face_count
    return in_threes(values, rows, lambda three: _place_three(three, topology, blocks))


def _place_three(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W 3"]:
    mesh, count, edge_count = topology, topology.vertex_count, len(topology.edges)
    placed = np.empty((count + edge_count + mesh.face_count, WIDTH))
    vertices, at_edges, at_faces = np.split(placed, [count, count + edge_count])
    read, counts = mesh.connectivity, np.empty(count, np.int32)
    blocks.run(mesh.face_count, kernels.place_faces, points, read, at_faces)
    blocks.run(edge_count, kernels.place_edges, points, at_faces, read, mesh.soft, at_edges)
    around = points, at_faces, read, mesh.corner_reach, False, MIDPOINT
    blocks.owners(count).run(count, kernels.sum_corners, *around, vertices, counts)
    blocks.run(count, kernels.blend_corners, points, counts, vertices)
    follow_curves(points, topology, CURVE, vertices)
    return placed
