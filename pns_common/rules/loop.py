"""Loop's two rules."""

from __future__ import annotations

from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.placement import Placement, without_correction


def loop_vertex_rule(level: ControlLevel) -> Placement:
    """Place old vertices by Loop's rule."""
    return without_correction(loop_vertex_vertices(level.points, level.topology))


def loop_edge_rule(level: ControlLevel) -> Placement:
    """Place edge vertices by Loop's rule."""
    points, topology = level.points, level.topology
    (positions,) = level.blocks.gather(
        len(topology.edges), lambda rows: (loop_edge_vertices(points, topology, rows),)
    )
    return without_correction(positions)
