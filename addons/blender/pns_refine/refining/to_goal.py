"""Faces only where the surface bends: triangles of several levels, with all that hangs on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import MeshError, refine, sharp_edges
from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.carry.carried import scaled_to_unit
from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.normals import angle_weighted_normals, smooth_fans
from pns_common.mesh.topology import MOSTLY_SHARP, Topology
from pns_common.parallel import Blocks, available_threads

from .compute import Choice, compute, edge_values, scheme_of, split_vertices
from .hidden import hide_within
from .shading import shaded
from .shown_creases import shown_creases
from .snapshot import Control, Faces, Layer, Refined, Rule, Snapshot
from .steps import edge_numbers

Progress = Callable[[float], None]


def refine_snapshot(
    snapshot: Snapshot, choice: Choice, progress: Progress = lambda share: None
) -> Refined:
    """Refine all of a snapshot, by whole levels or to a goal; ``progress`` as of ``compute``.

    Raises:
        PnsError: the mesh cannot be refined so, or the model fails.
    """
    if not choice.goals:
        return compute(snapshot, choice, progress)
    _check(snapshot, choice)
    scheme = scheme_of(snapshot, choice, lambda: progress(0.0))
    control = snapshot.control(whole=False)
    creases = _creases(snapshot, control, choice)
    made = cast(
        AdaptiveRefinement,
        refine(
            control.mesh,
            scheme,
            **choice.goals,
            creases=creases,
            progress=lambda done, total: progress(0.5 * done / total),
        ),
    )
    progress(0.8)
    return _refined(snapshot, control, made, smooth=choice.crease_lines)


def _check(snapshot: Snapshot, choice: Choice) -> None:
    """Check that a mesh can be refined to a goal. Raises MeshError."""
    if snapshot.has_polygons:
        text = "Detail is for triangles, and this mesh has quads or larger faces, which are refined"
        raise MeshError(f"{text} by whole levels: choose Levels, or triangulate it (Ctrl T)")
    if not choice.limit:
        raise MeshError("Detail puts vertices on the limit surface: switch On Limit Surface on")
    sharpness = snapshot.crease_sharpness
    if ((sharpness > 0) & np.isfinite(sharpness)).any():
        text = "Detail keeps creases of 1 alone, and this mesh has some that wear off"
        raise MeshError(f"{text}: set them to 1, or choose Levels")


def _creases(snapshot: Snapshot, control: Control, choice: Choice) -> Creases:
    """Return the edges and vertices that are sharp: shown, marked, or bent beyond the angle."""
    shown = NO_CREASES
    if choice.crease_lines:
        shown = shown_creases(snapshot, control, scheme_of(snapshot, choice))
    marked = (snapshot.crease_sharpness > 0) & snapshot.edge_used
    pairs = [snapshot.edges[marked]]
    if choice.crease_angle is not None:
        pairs.append(sharp_edges(control.mesh, float(np.degrees(choice.crease_angle))))
    vertices = np.flatnonzero(snapshot.vertex_sharpness)
    return replace(
        shown.with_named(np.concatenate(pairs)),
        vertices=vertices,
        vertex_sharpness=snapshot.vertex_sharpness[vertices],
        border=choice.border,
    )


def _refined(
    snapshot: Snapshot,
    control: Control,
    made: AdaptiveRefinement,
    *,
    smooth: bool,
) -> Refined:
    mesh, cage = made.mesh, made.control.topology
    topology, points = mesh.topology(), mesh.vertices
    parents = _side_parents(made, topology)
    loose = np.flatnonzero(~snapshot.edge_used)
    edges = np.concatenate([topology.edges, snapshot.edges[loose]])
    sharp = (parents >= 0) & (cage.sharpness > MOSTLY_SHARP)[parents]
    own = np.full(len(cage.edges), -1, dtype=np.int64)
    numbers = edge_numbers(cage, snapshot.edges)
    own[numbers[numbers >= 0]] = np.flatnonzero(numbers >= 0)
    edge_parents = np.r_[np.where(parents >= 0, own[parents], -1), loose]
    carry = _Carry(control, made, edge_parents)
    offsets = snapshot.offsets
    moves = made.carry(np.concatenate([snapshot.groups, *offsets], axis=1))
    count = snapshot.groups.shape[1]
    layers = [layer.of(carry(layer)) for layer in snapshot.layers]
    layers = shaded(
        layers, sharp, len(loose), lambda sharp: _normals(made, topology, sharp), smooth=smooth
    )
    faces = Faces(
        starts=np.arange(0, topology.corners.size + 1, 3),
        vertices=mesh.faces.reshape(-1).astype(np.int64),
        edges=topology.corner_edges.astype(np.int64),
        parents=control.polygons[made.face_parents],
    )
    old, nothing = len(snapshot.points), np.zeros(len(points))
    vertex_sharpness = nothing.copy()
    vertex_sharpness[:old] = np.where(np.isinf(snapshot.vertex_sharpness), np.inf, 0.0)
    return Refined(
        points=points,
        faces=faces,
        edges=edges,
        crease_sharpness=np.where(edge_parents >= 0, snapshot.crease_sharpness[edge_parents], 0.0),
        vertex_sharpness=vertex_sharpness,
        groups=np.clip(moves[:, :count], 0, 1),
        offsets=moves[:, count:].reshape(len(points), len(offsets), 3).transpose(1, 0, 2),
        layers=hide_within(tuple(layers), faces, edges, edge_parents < 0, old, len(points)),
        ratio=nothing,
        gate=nothing,
        distance=np.linalg.norm(points - made.carry(control.mesh.vertices), axis=1),
        normals=made.normals,
        report=dict(made.report),
        split_vertices=split_vertices(snapshot, cage),
    )


def _side_parents(made: AdaptiveRefinement, topology: Topology) -> Int[np.ndarray, " E"]:
    """Return the edge of the control mesh that each edge is a piece of; −1 for those inside."""
    both = np.stack([made.weights, np.roll(made.weights, -1, axis=1)])
    # Of a point on a side the weight of the corner opposite is 0.
    on_side = (both == 0).all(axis=0)
    rows, corner, opposite = np.nonzero(on_side)
    parents = np.full(len(topology.edges), -1, dtype=np.int64)
    cage = made.control.topology
    sides = cage.face_edges[made.face_parents[rows], (opposite + 1) % 3]
    parents[topology.face_edges[rows, corner]] = sides
    return parents


def _normals(
    made: AdaptiveRefinement, topology: Topology, sharp: Bool[np.ndarray, " E"]
) -> Float[np.ndarray, "C 3"]:
    """Return the limit surface's normal at each corner; along sharp edges that of its own side."""
    faces, points = made.mesh.faces, made.mesh.vertices
    pairs = topology.edges[sharp]
    fans = smooth_fans(faces, len(points), pairs)
    blocks = Blocks(available_threads())
    sides = angle_weighted_normals(points, faces, fans, int(fans.max()) + 1, blocks)[fans]
    own = np.asarray(made.normals)[faces]
    several = np.isin(faces, pairs) | ~own.any(axis=2)
    return np.where(several[..., None], sides, own).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class _Carry:
    """Carry a layer's values to the new points, edges, faces or corners."""

    control: Control
    made: AdaptiveRefinement
    edge_parents: Int[np.ndarray, " E"]

    def __call__(self, layer: Layer) -> np.ndarray:
        values: np.ndarray = getattr(self, f"_{layer.domain.name.lower()}")(layer)
        return values

    def _point(self, layer: Layer) -> np.ndarray:
        values, made = layer.values, self.made
        if layer.rule is Rule.BLEND:
            carried = made.carry(values)
            return scaled_to_unit(carried) if layer.unit else carried
        count = len(made.mesh.vertices)
        if layer.rule is Rule.KEEP:
            return np.concatenate([values, np.zeros((count - len(values), *values.shape[1:]))])
        # The value of the heaviest parent; of equals the smallest.
        parents = made.parents
        keys = -values[parents.columns, 0].astype(np.float64), np.round(parents.weights, 6)
        order = np.lexsort((*keys, parents.rows))
        return values[parents.columns[order[parents.starts[1:] - 1]]]

    def _edge(self, layer: Layer) -> np.ndarray:
        return edge_values(layer, self.edge_parents)

    def _face(self, layer: Layer) -> np.ndarray:
        return layer.values[self.control.polygons][self.made.face_parents]

    def _corner(self, layer: Layer) -> np.ndarray:
        values, made = layer.values[self.control.corners], self.made
        if layer.rule is Rule.BLEND:
            carried = made.at_corners(values).reshape(-1, values.shape[1])
            return scaled_to_unit(carried) if layer.unit else carried
        nearest = 3 * made.face_parents[:, None] + made.weights.argmax(axis=2)
        return values[nearest.reshape(-1)]
