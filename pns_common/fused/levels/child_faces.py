"""The faces that a step made, as ``pns_common.geometry.child_faces`` looks at them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.normals import HELD, flipped_children, largest_jump
from pns_common.fused.kernels.together import TOGETHER
from pns_common.fused.levels.mesh_edges import MeshEdges
from pns_common.geometry.child_faces import ChildAngles, angle_of_chord


def look_at_children(
    parent: MeshEdges,
    points: Float[np.ndarray, "W 3"],
    loop_points: Float[np.ndarray, "W 3"] | None,
    blocks: Blocks,
) -> ChildAngles:
    """Look at the faces that ``parent`` was split into, as pns_common.geometry.child_faces does."""
    count = len(parent.faces)
    jumps, largest_yet = np.zeros(blocks.count(count)), np.zeros(1)
    flipped = np.zeros(blocks.count(count), dtype=np.int64)
    faces, vertices = (parent.faces, parent.face_edges), parent.vertex_count
    edges = parent.half_edges, parent.edge_class

    def look(rows: slice) -> None:
        block, bounds = blocks.number(rows, count), (vertices, rows.start, rows.stop)
        held = np.empty(HELD * TOGETHER)
        jumps[block] = largest_jump(points, *faces, *edges, *bounds, largest_yet, held)
        if loop_points is not None:
            flipped[block] = flipped_children(points, loop_points, *faces, *bounds)

    blocks.run(count, look)
    return ChildAngles(int(flipped.sum()), angle_of_chord(jumps.max(initial=0)))
