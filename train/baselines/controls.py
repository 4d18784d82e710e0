"""Untrained controls: what anyone can have without a network. A learned rule has to beat them.

Loop's limit surface runs inside a convex control mesh. With e_v = p_v − (Loop's limit position of
v), m_v the unit normal of the faces at v, weighted by area:

    flat   no refinement at all: every edge at its midpoint
    Q1     Loop on p + e: full quasi-interpolation, once
    N1     Loop on p + (e · m) m: the same along the normal
    NC     N1 × 0.6, each vertex's share of it clipped to C h² / R, and at edges gated, as PNS is
"""

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import norm
from pns_common.geometry.frames import edge_frames, edge_stencil
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.schemes import (
    ControlLevel,
    Placement,
    Scheme,
    loop_edge_rule,
    loop_vertex_rule,
)
from train.baselines.placement import kept_vertices, midpoints, placed_edges
from train.surfaces.quasi_interpolation import added_to, normal_push

CLIPPED_STRENGTH = 0.6
# C of NC, in units of R.
CLIPPED_BUDGET = 0.8

GATE = 1e5


def flat() -> Scheme:
    """Return midpoint subdivision: the control mesh itself, with more faces."""
    return Scheme("flat", kept_vertices, lambda level: placed_edges(level, midpoints(level)))


def nc() -> Scheme:
    """Return 0.6 of N1, gated at edges and clipped to C h² / R at the first level, then Loop."""

    def edge_rule(level: ControlLevel) -> Placement:
        base, interior = loop_edge_rule(level), level.topology.interior
        share = loop_edge_vertices(CLIPPED_STRENGTH * normal_push(level), level.topology)[interior]
        stencil, faces = level.topology.stencil[interior], level.topology.edge_faces[interior]
        frames = edge_frames(edge_stencil(level.points, level.normals, stencil, faces))
        gate = np.tanh(GATE * frames.curvature**2)
        placed = np.zeros_like(base.loop)
        placed[interior] = gate[:, None] * _clipped(share, frames.length**2, level)
        return added_to(base, placed)

    def vertex_rule(level: ControlLevel) -> Placement:
        base = loop_vertex_rule(level)
        share = loop_vertex_vertices(CLIPPED_STRENGTH * normal_push(level), level.topology)
        return added_to(base, _clipped(share, level.rings.square[:, 0], level))

    return Scheme("nc", vertex_rule, edge_rule, learned_levels=1)


def _clipped(
    vectors: Float[np.ndarray, "N 3"], square: Float[np.ndarray, " N"], level: ControlLevel
) -> Float[np.ndarray, "N 3"]:
    """Return vectors no longer than C h² / R."""
    if level.reference_length == 0:
        return np.zeros_like(vectors)
    longest = CLIPPED_BUDGET / level.reference_length * square
    length = norm(vectors)
    return vectors * (longest / np.maximum(np.maximum(length, longest), 1e-300))[:, None]
