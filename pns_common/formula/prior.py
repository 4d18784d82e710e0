"""The prior D: what Loop's masks make of small pushes that undo Loop's shrinking.

Loop's limit surface runs inside a convex control mesh: the limit of a vertex of valence k is
(1 − w_k) p + w_k (mean of its neighbours). Pushing each vertex outwards by as much as that takes it
in, along its normal,

    d_v = −s w_k (u_v · m̂_v) m̂_v        u_v umbrella, m̂_v unit normal

and then subdividing by Loop is quasi-interpolation; D_v and D_e, Loop's two masks applied to d,
are what one level of that adds to Loop. D is 0 on planes, linear in scale, and the same for a mesh
turned over. d is 0 at boundary, irregular and crease edges, and where several fans meet, but not at
darts, where a crease ends: Loop's rule takes them in, and beside what is kept they would be dents.
"""

from __future__ import annotations

from jaxtyping import Float

from pns_common.base.arrays import Array, beside, dot, namespace, norm
from pns_common.geometry.rings import Rings
from pns_common.masks.stencils import limit_ring_weight

# Below this length the mean normal of a ring, 1 where its faces agree, is no longer scaled to 1: it
# fades to 0 where there is none to speak of, and stays Lipschitz. A regular tetrahedron's is 1/3.
CLEAR_NORMAL = 1 / 4


def normal_pushes(rings: Rings) -> Float[Array, "V 3"]:
    """Return d_v of all vertices for s = 1; everything after it is linear in s."""
    normal, topology = clear_normals(rings.normal), rings.topology
    weight = limit_ring_weight(topology.valence) * topology.ringed_vertices
    inwards = beside(rings.points, weight, rings.points.dtype) * dot(rings.umbrella, normal)
    return -inwards[:, None] * normal


def clear_normals(mean: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return m̂ of mean normals: of length 1, less where they are shorter than ``CLEAR_NORMAL``."""
    agreement = norm(mean)[:, None]
    return mean / namespace(mean).where(agreement > CLEAR_NORMAL, agreement, CLEAR_NORMAL)
