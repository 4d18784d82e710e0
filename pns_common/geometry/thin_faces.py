"""Thin faces: the lengths in which a network speaks beside them, and the h of the bound there.

    ℓ_e = min(h, α a) min(1, 3 α t)²     a the lower of both faces' altitudes over the edge, t the
                                         larger of their lowest altitudes over longest sides
    ℓ_v = root mean square of ℓ_e over the spokes of an old vertex
    h̄   = the longest edge of both faces

A child of a face turns by what its corners are moved apart over its altitude. Where faces are 40
times as long as wide, an answer of the network that is right to a twentieth of h turns children by
a right angle; in units of min(h, α a) it turns them no further than on faces as wide as long.

Rows of thin faces, as of a hose of few sides and many rings, turn like that in every row: ripples,
which bend the more the thinner the rows are. So less is asked where both faces are thin, longer
than 3 α of their altitudes, and next to nothing where they are very thin: the prior alone is
smooth. A sliver between other faces makes no row, and asks as before.

And a short edge between two long ones has to go where these go: ρ of its own h would hold it back,
and leave teeth as high as the correction. So the bound counts h̄, which is as good an h for
everything that is proved with it (docs/theorems.md, 9).
"""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float

from pns_common.base.arrays import Array, beside, gather, namespace, norm, scatter
from pns_common.connectivity.topology import EdgeClass
from pns_common.geometry.frames import EdgeFrames, EdgeStencil
from pns_common.geometry.rings import Rings, root

# So many times α is what a face that is not thin may be long, in altitudes.
OF_ALTITUDES = 3.0


@dataclass(frozen=True, eq=False)
class NetworkLengths:
    """The network's unit of length.

    Attributes:
        at_edges: ℓ_e of all edges; h where an edge is not interior.
        at_vertices: ℓ_v.
    """

    at_edges: Float[Array, " E"]
    at_vertices: Float[Array, "V 1"]


def network_lengths(rings: Rings, altitudes: float | None) -> NetworkLengths:
    """Return ℓ of a level; ``altitudes`` is α > 0, or None for h and h_v whatever the faces."""
    length = norm(rings.spokes[::2])
    if altitudes is None:
        return NetworkLengths(length, rings.spoke_length)
    xp, topology = namespace(length), rings.topology
    interior, count = topology.interior, len(topology.edges)
    faces = topology.edge_faces[interior]
    areas = (gather(rings.double_areas, faces[:, side]) for side in range(2))
    square, inner = rings.edge_squares, gather(length, interior)
    wide = altitudes * xp.minimum(*areas) / xp.where(inner > 0, inner, 1.0)
    shapes = (gather(_shapes(rings), faces[:, side]) for side in range(2))
    share = OF_ALTITUDES * altitudes * xp.maximum(*shapes)
    ell = xp.minimum(wide, inner) * xp.where(share < 1, share * share, 1.0)
    is_interior = beside(length, topology.edge_class == EdgeClass.INTERIOR)
    at_edges = xp.where(is_interior, scatter(ell, interior, count), length)
    # Where nothing is shorter the square is h's own, so that ℓ_v has the bits of h_v.
    squares = xp.where(at_edges < length, at_edges * at_edges, square)
    return NetworkLengths(at_edges, root(rings.mean_of_edges(squares)))


def _shapes(rings: Rings) -> Float[Array, " F"]:
    """Return the lowest altitudes of faces over their longest sides, 0 … √3/2."""
    sides = (gather(rings.edge_squares, rings.topology.face_edges[:, k]) for k in range(3))
    first, second, third = sides
    xp = namespace(first)
    longest = xp.maximum(xp.maximum(first, second), third)
    return rings.double_areas / xp.where(longest > 0, longest, 1.0)


def longest_side(stencil: EdgeStencil, frames: EdgeFrames) -> Float[Array, " N"]:
    """Return h̄ of interior edges."""
    xp, longest = namespace(frames.length), frames.length
    for wing in (stencil.c, stencil.d):
        for end in (stencil.a, stencil.b):
            longest = xp.maximum(longest, norm(wing - end))
    return longest
