"""Edges and vertices of a mesh that are sharp: marked, bent, or shown by the mesh's shading."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import Creases, sharp_edges

from .snapshot import Control, Snapshot, edge_keys

SHARPEST = 10.0


def crease_sharpness_of(crease: Float[np.ndarray, " E"]) -> Float[np.ndarray, " E"]:
    """Return Blender's crease c, 0 … 1, as a number of levels: 10 c², and 1 for good."""
    return np.where(crease >= 1, np.inf, SHARPEST * np.clip(crease, 0, 1) ** 2)


def crease_of(crease_sharpness: Float[np.ndarray, " E"]) -> Float[np.ndarray, " E"]:
    """Return the crease that is sharp for so many levels."""
    return np.sqrt(np.clip(crease_sharpness / SHARPEST, 0, 1))


@dataclass(frozen=True, kw_only=True)
class Sharp:
    """Edges that stay sharp, beside those that are marked.

    Those whose faces meet at more than ``crease_angle`` (radians), if it is given; and with
    ``crease_lines`` those that the mesh or its shading shows, where the model's card asks for it.
    ``border`` is the rule of boundaries, as in ``pns_common.Creases``.
    """

    crease_angle: float | None = None
    crease_lines: bool = True
    border: str = "smooth"


def marked_creases(snapshot: Snapshot, control: Control, chosen: Sharp) -> Creases:
    """Return edges and vertices that are marked, and edges bent beyond the chosen angle."""
    marked = (snapshot.crease_sharpness > 0) & control.there
    pairs, sharpness = snapshot.edges[marked], snapshot.crease_sharpness[marked]
    if chosen.crease_angle is not None:
        bent = sharp_edges(control.mesh, float(np.degrees(chosen.crease_angle)))
        pairs = np.concatenate([pairs, bent])
        sharpness = np.r_[sharpness, np.full(len(bent), np.inf)]
    vertices = np.flatnonzero(snapshot.vertex_sharpness)
    return Creases(
        pairs,
        sharpness,
        vertices=vertices,
        vertex_sharpness=snapshot.vertex_sharpness[vertices],
        border=chosen.border,
        wears=True,
    )


def with_shown(
    marked: Creases, snapshot: Snapshot, control: Control, shown: Creases, *, for_good: bool
) -> Creases:
    """Add edges that a scheme finds, and hard edges of the shading, for as many levels.

    A mesh whose polygons meet at hard edges alone is flat-shaded, and shows none by that.
    """
    edges, hard = shaded_edges(snapshot, control)
    hard = edges[[] if hard.all() else hard]
    levels = np.inf if for_good or shown.levels is None else float(shown.levels)
    return replace(
        marked,
        named=np.concatenate([marked.named, hard]),
        sharpness=np.r_[marked.sharpness, np.full(len(hard), levels)],
        angle=shown.angle,
        learned=shown.learned,
        levels=shown.levels,
    )


def shaded_edges(
    snapshot: Snapshot, control: Control
) -> tuple[Int[np.ndarray, "N 2"], Bool[np.ndarray, " N"]]:
    """Return the edges between two polygons, and which are marked sharp or lie at flat faces."""
    topology = control.topology
    polygons = control.polygons[topology.face_of(topology.half_edges[topology.interior])]
    # A polygon's own diagonals have one normal on both sides.
    between = polygons[:, 0] != polygons[:, 1]
    edges = topology.edges[topology.interior][between].astype(np.int64)
    hard = snapshot.marked("sharp_face", "FACE")[polygons[between]].any(axis=1)
    sharp = snapshot.edges[snapshot.marked("sharp_edge", "EDGE")]
    return edges, hard | np.isin(edge_keys(edges), edge_keys(sharp))
