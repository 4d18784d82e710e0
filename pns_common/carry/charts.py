"""Data of corners, texture coordinates among it, smooth inside the charts that it forms.

A chart is a piece of the surface on which the values are continuous: corners are one point where
their vertex and their values are one. Inside a chart the base scheme's masks are used, as for the
vertices. On its border values stay where they are and edges get their midpoints, so that both sides
of a seam keep meeting. Creases and corners of the surface are those of the charts too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Real

from pns_common.errors import ParameterError
from pns_common.mesh.rows import as_words, distinct_rows, number_by_first_appearance
from pns_common.mesh.topology import EdgeClass, Topology, build_topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.loop import LOOP


def refine_corners(
    values: Real[np.ndarray, "H K"],
    topologies: Sequence[Topology],
    base: BaseScheme = LOOP,
    blocks: Blocks | None = None,
) -> Float[np.ndarray, "C N K"]:
    """Return values at the corners of the refined faces.

    Args:
        values: a row for each corner of the control mesh, face after face.
        topologies: those of the meshes that are refined, control mesh first, as of
            ``Refinement.topologies``; their scheme is ``base``.
        base: the scheme.
        blocks: how the work is shared.

    Raises:
        ParameterError: there is not one row for each corner.
    """
    first, blocks = topologies[0], blocks or Blocks()
    if values.ndim != 2 or len(values) != len(first.corners):
        expected = f"({len(first.corners)}, K), a row for each corner"
        raise ParameterError("values.shape", values.shape, expected=expected)
    vertices = as_words(first.corners[:, None])
    rows = distinct_rows(np.hstack([vertices, as_words(values + 0.0)]))
    points, at = number_by_first_appearance(rows)
    columns = values[at].astype(np.float64)
    chart = build_topology((points, first.offsets), len(columns), blocks)
    for depth, surface in enumerate(topologies):
        chart = base.split(chart, blocks, inherit=False) if depth else chart
        # The corners of both meshes correspond: an edge has the sharpness of that of its corner.
        edges = surface.corner_edges[chart.half_edges[:, 0]]
        inside = np.where(surface.edge_class == EdgeClass.IRREGULAR, 0.0, surface.sharpness)
        chart = chart.with_sharpness(inside[edges])
        if len(surface.vertex_sharpness):
            vertex_of = np.zeros(chart.vertex_count, dtype=np.int64)
            vertex_of[chart.corners] = surface.corners
            chart = chart.with_vertex_sharpness(surface.vertex_sharpness[vertex_of])
        border = (chart.edge_class == EdgeClass.BOUNDARY) | (
            chart.edge_class == EdgeClass.IRREGULAR
        )
        rim = chart.edges[border].reshape(-1)
        refined = base.place(columns, chart, blocks)
        refined[rim] = columns[rim]
        columns = refined
    return columns[base.faces(chart, blocks, np.int64)]
