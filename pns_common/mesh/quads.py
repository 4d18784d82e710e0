"""The split of polygons into quads, one for each corner.

The vertex of edge e is V + e, that of face f is V + E + f; old vertices keep their numbers. The
quad of corner h is (its vertex, the vertex of the edge that leaves it, the face's vertex, that of
the edge that enters it), and it is face h of the refined mesh.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Integer

from pns_common.kernels import split
from pns_common.mesh.topology import QUAD, Topology, split_into
from pns_common.parallel import Blocks


def quad_faces(
    parent: Topology, blocks: Blocks, dtype: type[np.uint32] | type[np.int64] = np.uint32
) -> Integer[np.ndarray, "H 4"]:
    """Return the quads of the split of a mesh of any polygons."""
    faces = np.empty((len(parent.corners), QUAD), dtype=dtype)
    blocks.run(parent.face_count, split.split_into_quads, parent.connectivity, faces)
    return faces


def split_quads(parent: Topology, blocks: Blocks, *, inherit: bool = True) -> Topology:
    """Return the topology of the split; ``inherit``: whether halves of edges stay sharp."""
    return split_into(quad_faces(parent, blocks), parent, blocks, inherit=inherit)
