"""Data of corners, texture coordinates among it, smooth inside the charts that it forms.

A chart is a piece of the surface on which the values are continuous: corners are one point where
their vertex and their values are one. Inside a chart the base scheme's masks are used, as for the
vertices. On its border values stay where they are and edges get their midpoints, so that both sides
of a seam keep meeting. Creases and corners of the surface are those of the charts too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from jaxtyping import Float, Inexact, Integer, Real, Shaped

from pns_common.carry.rules import linear
from pns_common.errors import ParameterError
from pns_common.mesh.rows import as_words, distinct_rows, first_places, number_by_first_appearance
from pns_common.mesh.topology import EdgeClass, Topology, build_topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.limit import limit_positions
from pns_common.schemes.loop import LOOP

# Which values stay in place or are linear, by OpenSubdiv's names (FVAR_LINEAR_…).
Linear = Literal["none", "corners only", "boundaries", "all"]


def refine_corners(
    values: Real[np.ndarray, "H K"],
    topologies: Sequence[Topology],
    base: BaseScheme = LOOP,
    blocks: Blocks | None = None,
    *,
    keep: Linear = "boundaries",
    same: Shaped[np.ndarray, "H J"] | None = None,
    limit: bool = False,
) -> Float[np.ndarray, "C N K"]:
    """Return values at the corners of the refined faces.

    Args:
        values: a row for each corner of the control mesh, face after face.
        topologies: those of the meshes that are refined, control mesh first, as of
            ``Refinement.topologies``; their scheme is ``base``.
        base: the scheme.
        blocks: how the work is shared.
        keep: what stays linear: "boundaries" of charts; "corners only": of one face; "all"; "none".
        same: corners of a vertex that agree in these are one point; None: that agree in values.
        limit: apply the limit mask at the end, where the surface's vertices are on the limit.

    Raises:
        ParameterError: there is not one row for each corner.
    """
    first, blocks = topologies[0], blocks or Blocks()
    if values.ndim != 2 or len(values) != len(first.corners):
        expected = f"({len(first.corners)}, K), a row for each corner"
        raise ParameterError("values.shape", values.shape, expected=expected)
    points, at = chart_points(first.corners, values if same is None else same)
    charts = charts_of(points, topologies, base, blocks)
    columns, faces = refine_charts(
        values[at].astype(np.float64), charts, base, blocks, keep=keep, limit=limit
    )
    return columns[faces]


def chart_points(
    vertices: Integer[np.ndarray, " H"], values: Shaped[np.ndarray, "H K"]
) -> tuple[Integer[np.ndarray, " H"], Integer[np.ndarray, " P"]]:
    """Return the point of a chart at each corner, and the first corner of each point."""
    leader = first_places(vertices, int(vertices.max(initial=0)) + 1)[vertices]
    # Corners that agree with their vertex's first are found without sorting: on most meshes, all.
    odd = (values != values[leader]).any(axis=1)
    labels = leader
    if odd.any():
        words = [as_words(vertices[odd].astype(np.int64)[:, None]), as_words(values[odd] + 0)]
        labels = labels.copy()
        labels[odd] = len(leader) + distinct_rows(np.hstack(words))
    return number_by_first_appearance(labels)


def charts_of(
    points: Integer[np.ndarray, " H"],
    topologies: Sequence[Topology],
    base: BaseScheme,
    blocks: Blocks,
) -> list[Topology]:
    """Return the topologies of charts at each level, with the surface's sharpness inside."""
    charts, plain = list[Topology](), None
    count = int(points.max(initial=-1)) + 1
    for surface in topologies:
        plain = chart = (
            build_topology((points, surface.offsets), count, blocks)
            if plain is None
            else base.split(plain, blocks, inherit=False)
        )
        # The corners of both meshes correspond: an edge has the sharpness of that of its corner.
        if len(surface.sharp_edges) or len(surface.soft):
            edges = surface.corner_edges[chart.half_edges[:, 0]]
            inside = surface.edge_class[edges] != EdgeClass.IRREGULAR
            chart = chart.with_sharpness(np.where(inside, surface.sharpness[edges], 0.0))
            if len(surface.wear):
                inside &= plain.edge_class == EdgeClass.INTERIOR
                kept = {"wear": surface.wear, "found": surface.found}
                chart = replace(
                    chart, **{k: np.where(inside, v[edges], 0.0) for k, v in kept.items() if len(v)}
                )
        if surface.has_corners:
            vertex_of = np.zeros(chart.vertex_count, dtype=np.int64)
            vertex_of[chart.corners] = surface.corners
            if len(surface.vertex_sharpness):
                chart = chart.with_vertex_sharpness(surface.vertex_sharpness[vertex_of])
            if len(surface.soft_corners):
                chart = chart.with_soft_corners(surface.soft_corners[vertex_of])
        charts.append(chart)
    return charts


def refine_charts(
    columns: Inexact[np.ndarray, "P K"],
    charts: Sequence[Topology],
    base: BaseScheme,
    blocks: Blocks,
    *,
    keep: Linear = "boundaries",
    limit: bool = False,
) -> tuple[Inexact[np.ndarray, "N K"], Integer[np.ndarray, "G M"]]:
    """Refine values at the points of charts; return also the points of the refined faces."""
    for chart in charts:
        if keep == "all":
            columns = linear(columns, chart, base, blocks)
            continue
        rim, refined = _staying(chart, keep), base.place(columns, chart, blocks)
        refined[rim] = columns[rim]
        columns = refined
    if limit and keep != "all":
        last = base.split(charts[-1], blocks)
        rim, refined = _staying(last, keep), limit_positions(columns, last, blocks, base)
        refined[rim] = columns[rim]
        columns = refined
    return columns, base.faces(charts[-1], blocks, np.int64)


def _staying(chart: Topology, keep: Linear) -> Integer[np.ndarray, " S"]:
    """Return points that stay, of which some occur twice."""
    if keep == "none":
        return np.zeros(0, dtype=np.int64)
    open_edges = (EdgeClass.BOUNDARY, EdgeClass.IRREGULAR)
    rim = chart.edges[np.isin(chart.edge_class, open_edges)].reshape(-1)
    if keep == "corners only":
        rim = rim[np.bincount(chart.corners, minlength=chart.vertex_count)[rim] == 1]
    return rim
