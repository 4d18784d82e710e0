"""A snapshot and what is asked of it in, the refined mesh with all that hangs on it out."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pns_common import MeshError, Scheme, loop, pns, refine
from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.carry import rules
from pns_common.carry.carried import Column
from pns_common.carry.charts import Linear
from pns_common.mesh.topology import EdgeClass, Topology
from pns_common.model.file import COMPANIONS, companion_of
from pns_common.model.session import Model
from pns_common.operator.scheme import named_scheme

from .creases import Sharp, marked_creases, with_shown
from .hidden import hide_within
from .shading import shaded
from .snapshot import Control, Layer, Refined, Snapshot
from .surfaces import SeveralLevels, Surface, WholeLevels

Progress = Callable[[float], None]
# Shares of the work: where positions, those of the base scheme, and values of vertices are done.
POSITIONS, BASE, VERTICES = 0.6, 0.75, 0.9


@dataclass(frozen=True)
class Choice(Sharp):
    """Options of one refinement.

    ``model`` is the learned correction and ``budget`` its C; without a model it is Loop.
    ``uv_keep`` is what stays linear of UV maps. ``tolerance``, ``angle``
    or ``max_faces`` (as of ``pns_common.refine``) make faces only where the surface bends, and
    ``levels`` has no effect.
    """

    model: Model | None
    levels: int
    budget: float | None = None
    limit: bool = True
    uv_keep: Linear = "boundaries"
    tolerance: str | None = None
    angle: float | None = None
    max_faces: int | None = None

    @property
    def goals(self) -> dict[str, Any]:
        """Goals of faces of several levels, as arguments of the library's refine."""
        given = {name: getattr(self, name) for name in ("tolerance", "angle", "max_faces")}
        return {name: goal for name, goal in given.items() if goal is not None}


def compute(snapshot: Snapshot, choice: Choice, progress: Progress = lambda share: None) -> Refined:
    """Refine all of a snapshot; ``progress`` is told the share that is done, and may raise to stop.

    Raises:
        PnsError: the mesh cannot be refined so, or the model fails.
    """
    scheme = scheme_of(snapshot, choice)
    if choice.goals:
        _check_goal(snapshot, choice, polygons=scheme.base.polygons)
    control = snapshot.control(whole=scheme.base.polygons)
    creases = marked = marked_creases(snapshot, control, choice)
    shows = choice.crease_lines and scheme.creases.finds
    if shows:
        creases = with_shown(marked, snapshot, control, scheme.creases, for_good=bool(choice.goals))
    asked = choice.goals or {"levels": choice.levels, "limit": choice.limit}
    told = _part(progress, 0.0, POSITIONS)
    made = refine(control.mesh, scheme, **asked, creases=creases, progress=told)
    surface: Surface
    if isinstance(made, AdaptiveRefinement):
        surface, plain = SeveralLevels(made), made.carry(control.mesh.vertices)
    else:
        surface, plain = WholeLevels(made), made.mesh.vertices
        if choice.model is not None:
            # The base scheme alone knows of no lines.
            base, told = named_scheme(scheme.base.name), _part(progress, POSITIONS, BASE)
            plain = refine(control.mesh, base, **asked, creases=marked, progress=told).mesh.vertices
    offsets, groups = snapshot.offsets, snapshot.groups
    moved = np.concatenate([groups, *offsets], axis=1)
    moved = surface.at_vertices(Column(moved, rules.smooth))
    progress(VERTICES)
    loose = np.flatnonzero(~snapshot.edge_used)
    parents = np.where(surface.edge_parents >= 0, control.own_edge[surface.edge_parents], -1)
    parents = np.r_[parents, loose]
    layers = []
    for layer in snapshot.layers:
        layers.append(replace(layer, values=_carried(layer, surface, control, parents, choice)))
        progress(VERTICES + (1 - VERTICES) * len(layers) / len(snapshot.layers))
    normals = None if made.normals is None else surface.normals
    layers = shaded(layers, surface.sharp, len(loose), normals, smooth=shows)
    topology, old, count = surface.topology, len(snapshot.points), len(made.mesh.vertices)
    edges = np.concatenate([topology.edges, snapshot.edges[loose]])
    levels = sys.maxsize if choice.goals else choice.levels
    return Refined(
        points=made.mesh.vertices,
        topology=topology,
        polygons=control.polygons[surface.face_parents],
        edges=edges,
        crease_sharpness=_creases_left(snapshot, topology, parents, loose, levels),
        vertex_sharpness=np.r_[_left(snapshot.vertex_sharpness, levels), np.zeros(count - old)],
        groups=np.clip(moved[:, : groups.shape[1]], 0, 1),
        offsets=moved[:, groups.shape[1] :].reshape(count, len(offsets), 3).transpose(1, 0, 2),
        layers=hide_within(tuple(layers), topology, edges, parents < 0, old, count),
        ratio=surface.ratio,
        gate=surface.gate,
        distance=np.linalg.norm(made.mesh.vertices - plain, axis=1),
        report=dict(made.report),
        split_vertices=split_vertices(snapshot, control.topology),
    )


def scheme_of(snapshot: Snapshot, choice: Choice) -> Scheme:
    """Return the scheme of a choice; for polygons it is that of the model's companion, if any."""
    model, budget = choice.model, choice.budget
    if model is None:
        return loop()
    if snapshot.has_polygons and model.name in COMPANIONS:
        # A budget that was left alone is the model's own.
        budget = None if budget == model.card.budget else budget
        model = companion_of(model)
    return pns(model, budget)


def _check_goal(snapshot: Snapshot, choice: Choice, *, polygons: bool) -> None:
    """Check that a mesh can be refined to a goal. Raises MeshError."""
    if polygons and choice.angle is not None:
        text = "Angle is for triangles, not for Catmull–Clark's quads: choose Tolerance"
        raise MeshError(f"{text} or Faces at Most, or triangulate the mesh (Ctrl T)")
    if not choice.limit:
        raise MeshError("Detail puts vertices on the limit surface: switch On Limit Surface on")
    sharpness = snapshot.crease_sharpness
    if ((sharpness > 0) & np.isfinite(sharpness)).any():
        text = "Detail keeps creases of 1 alone, and this mesh has some that wear off"
        raise MeshError(f"{text}: set them to 1, or choose Levels")


def _part(progress: Progress, begin: float, end: float) -> Callable[[int, int], None]:
    """Return a progress callback of the library's for a part of the work."""
    return lambda done, total: progress(begin + (end - begin) * done / max(total, 1))


def _carried(
    layer: Layer,
    surface: Surface,
    control: Control,
    edge_parents: Int[np.ndarray, " E"],
    choice: Choice,
) -> np.ndarray:
    """Carry an attribute's values to the new points, edges, faces or corners."""
    values = layer.values
    if layer.domain == "POINT":
        return surface.at_vertices(layer)
    if layer.domain == "FACE":
        return values[control.polygons][surface.face_parents]
    if layer.domain == "EDGE":
        # The last row is that of edges without a parent.
        return np.concatenate([values, np.zeros_like(values, shape=(1, values.shape[1]))])[
            edge_parents
        ]
    values = values[control.corners]
    keep = choice.uv_keep if layer.kind == "FLOAT2" else layer.keep
    # Directions are stored roughly: what differs by less than that is no seam.
    same = np.round(values, 3) if layer.unit else None
    return surface.at_corners(replace(layer, values=values, keep=keep, same=same))


def _left(sharpness: Float[np.ndarray, " N"], levels: int) -> Float[np.ndarray, " N"]:
    """Return what is left of sharpness after so many levels."""
    return np.maximum(sharpness - levels, 0.0)


def _creases_left(
    snapshot: Snapshot,
    topology: Topology,
    parents: Int[np.ndarray, " E"],
    loose: Int[np.ndarray, " L"],
    levels: int,
) -> Float[np.ndarray, " E"]:
    """Return what is left of each edge's sharpness; edges without faces keep theirs."""
    own = np.append(_left(snapshot.crease_sharpness, levels), 0.0)[parents]
    own[len(topology.edges) :] = snapshot.crease_sharpness[loose]
    if len(topology.wear):
        own[: len(topology.edges)] = np.maximum(own[: len(topology.edges)], topology.wear)
    return own


def split_vertices(snapshot: Snapshot, topology: Topology) -> int:
    """Count border vertices that lie where another does: there the surface will come apart."""
    border = topology.edges[topology.edge_class == EdgeClass.BOUNDARY]
    places = snapshot.points[np.unique(border)]
    _, which, counts = np.unique(places + 0.0, axis=0, return_inverse=True, return_counts=True)
    return int((counts[which.reshape(-1)] > 1).sum())
