"""A snapshot and what is asked of it in, the refined mesh with all that hangs on it out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pns_common import Creases, Scheme, loop, pns, sharp_edges
from pns_common.carry import rules
from pns_common.carry.carried import (
    Carrier,
    Column,
    edge_parents,
    refine_column,
    scaled_to_unit,
)
from pns_common.carry.charts import Linear
from pns_common.mesh.creases import NO_CREASES
from pns_common.mesh.topology import EdgeClass, Topology
from pns_common.model.file import COMPANIONS, companion_of
from pns_common.model.session import Model
from pns_common.operator.scheme import named_scheme
from pns_common.parallel import Blocks, available_threads

from .hidden import hide_within
from .positions import Positions, refine_positions
from .shading import corner_normals, shaded
from .shown_creases import shown_creases
from .snapshot import Control, Faces, Layer, Refined, Rule, Smoothing, Snapshot, edge_keys
from .steps import Steps, edge_numbers, level_steps, refine_columns
from .watched import WatchedModel

# What stays linear of a UV map, by Blender's names and by ours.
KEPT: dict[Smoothing, Linear] = {
    Smoothing.NONE: "all",
    Smoothing.PRESERVE_CORNERS: "corners only",
    Smoothing.PRESERVE_BOUNDARIES: "boundaries",
    Smoothing.SMOOTH_ALL: "none",
}
# How much of the work the positions are; the base scheme's own are needed for the distance.
SHARES = {"positions": 0.6, "base": 0.15, "columns": 0.15, "corners": 0.1}


@dataclass(frozen=True)
class Choice:
    """Options of one refinement.

    ``model`` is the learned correction and ``budget`` its C; without a model it is Loop.
    ``crease_angle`` (radians) makes edges sharp whose faces meet at a larger angle; None makes
    none. ``crease_lines`` keeps those sharp that the mesh or its shading shows, where the model's
    card asks for it. ``border`` is the rule of boundaries, as in ``pns_common.Creases``.
    ``uv_smooth`` is for UV maps. ``tolerance`` (as of ``pns_common.refine``) or ``max_faces`` make
    faces only where the surface bends, and ``levels`` has no effect.
    """

    model: Model | None
    levels: int
    budget: float | None = None
    limit: bool = True
    crease_angle: float | None = None
    crease_lines: bool = True
    border: str = "smooth"
    uv_smooth: Smoothing = Smoothing.PRESERVE_BOUNDARIES
    tolerance: str | None = None
    max_faces: int | None = None

    @property
    def goals(self) -> dict[str, Any]:
        """Goals of faces of several levels, as arguments of the library's refine."""
        given = {"tolerance": self.tolerance, "max_faces": self.max_faces}
        return {name: goal for name, goal in given.items() if goal is not None}


def compute(
    snapshot: Snapshot, choice: Choice, progress: Callable[[float], None] = lambda share: None
) -> Refined:
    """Refine all of a snapshot; ``progress`` is told the share that is done, and may raise to stop.

    Raises:
        PnsError: the mesh cannot be refined, or the model fails.
    """
    bar = _Bar(progress)
    scheme = scheme_of(snapshot, choice, bar.look_up)
    base = scheme.base
    control = snapshot.control(whole=base.polygons)
    mesh = control.mesh
    lines = shown_creases(snapshot, control, scheme) if choice.crease_lines else NO_CREASES
    soft, lines = soft_and_hard(lines)
    pairs, crease_sharpness = all_creases(snapshot, control, choice.crease_angle, lines)
    topology = mesh.topology().with_border(choice.border)
    topology = topology.with_vertex_sharpness(snapshot.vertex_sharpness)
    cage = topology, base, choice.levels
    steps = level_steps(*cage, pairs, crease_sharpness, soft)
    positions = refine_positions(
        mesh, scheme, steps, limit=choice.limit, progress=bar.within("positions")
    )
    plain = steps
    if any(found.named is not None and len(found.named) for found in (soft, lines)):
        # The base scheme alone knows of no lines.
        plain = level_steps(*cage, *all_creases(snapshot, control, choice.crease_angle))
    distance = _distance_from_base(control, choice, plain, positions, bar)

    offsets = snapshot.offsets
    moved = np.concatenate([snapshot.groups, *offsets], axis=1)
    columns = refine_columns(moved, steps, limit=choice.limit)
    bar.reach("columns")
    group_count = snapshot.groups.shape[1]
    moves = columns[:, group_count:]

    topologies = [step.topology for step in steps.steps]
    carrier = Carrier(topologies, base, choice.limit, Blocks(available_threads()))
    faces = _faces(control, steps, carrier)
    loose = np.flatnonzero(~snapshot.edge_used)
    own_edge = np.r_[_edge_parents(steps, snapshot), loose]
    carry = _Carry(control, choice, steps, carrier, own_edge)
    layers = []
    for number, layer in enumerate(snapshot.layers):
        layers.append(layer.of(carry(layer)))
        bar.reach("corners", (number + 1) / len(snapshot.layers))
    smooth = choice.crease_lines and scheme.creases.finds
    normals = None if positions.normals is None else partial(corner_normals, steps, positions)
    layers = shaded(layers, steps.at_last.is_sharp, len(loose), normals, smooth=smooth)
    edges = np.concatenate([steps.final.edges, snapshot.edges[loose]])
    old, count = len(snapshot.points), len(positions.points)
    vertex_sharpness = np.zeros(count)
    vertex_sharpness[:old] = np.maximum(snapshot.vertex_sharpness - choice.levels, 0.0)
    return Refined(
        points=positions.points,
        faces=faces,
        edges=edges,
        crease_sharpness=np.r_[_final_crease_sharpness(steps), snapshot.crease_sharpness[loose]],
        vertex_sharpness=vertex_sharpness,
        groups=np.clip(columns[:, :group_count], 0, 1),
        offsets=moves.reshape(len(columns), len(offsets), 3).transpose(1, 0, 2),
        layers=hide_within(tuple(layers), faces, edges, own_edge < 0, old, count),
        ratio=_at_later(positions.ratio, steps),
        gate=_at_later(positions.gate, steps),
        distance=distance,
        normals=positions.normals,
        report=positions.report,
        split_vertices=split_vertices(snapshot, steps.steps[0].topology),
    )


def scheme_of(
    snapshot: Snapshot, choice: Choice, look_up: Callable[[], None] = lambda: None
) -> Scheme:
    """Return the scheme of a choice; for polygons it is that of the model's companion, if any."""
    model, budget = choice.model, choice.budget
    if model is None:
        return loop()
    if snapshot.has_polygons and model.name in COMPANIONS:
        # A budget that was left alone is the model's own.
        budget = None if budget == model.card.budget else budget
        model = companion_of(model)
    return pns(WatchedModel(model, look_up), budget)


def soft_and_hard(lines: Creases) -> tuple[Creases, Creases]:
    """Return lines of sharpness below 1, and those of 1, of which something may be left."""
    if lines.named is None or lines.sharpness is None:
        return NO_CREASES, lines
    hard = lines.sharpness == 1
    named, corners = lines.named[~hard], lines.soft_corners
    soft = Creases(named, lines.sharpness[~hard], levels=lines.levels, soft_corners=corners)
    return soft, Creases(lines.named[hard], levels=lines.levels)


def all_creases(
    snapshot: Snapshot, control: Control, angle: float | None, lines: Creases = NO_CREASES
) -> tuple[Int[np.ndarray, "N 2"], Float[np.ndarray, " N"]]:
    """Return sharp edges, for how many levels: marked, bent beyond ``angle``, or named lines."""
    marked = (snapshot.crease_sharpness > 0) & snapshot.edge_used
    pairs, crease_sharpness = snapshot.edges[marked], snapshot.crease_sharpness[marked]
    found = []
    if angle is not None:
        bent = sharp_edges(control.mesh, float(np.degrees(angle)))
        found.append((bent, np.inf))
    if lines.named is not None:
        found.append((lines.named, np.inf if lines.levels is None else float(lines.levels)))
    for sharp, sharpness in found:
        pairs = np.concatenate([sharp, pairs])
        crease_sharpness = np.concatenate([np.full(len(sharp), sharpness), crease_sharpness])
    # An edge that is several has the largest sharpness: the first of equals stays.
    order = np.argsort(-crease_sharpness, kind="stable")
    pairs, crease_sharpness = pairs[order], crease_sharpness[order]
    _, first = np.unique(edge_keys(pairs), return_index=True)
    return pairs[first], crease_sharpness[first]


def split_vertices(snapshot: Snapshot, topology: Topology) -> int:
    """Count border vertices that lie where another does: there the surface will come apart."""
    border = topology.edges[topology.edge_class == EdgeClass.BOUNDARY]
    places = snapshot.points[np.unique(border)]
    if len(places) == 0:
        return 0
    order = np.lexsort(places.T)
    same = (np.diff(places[order], axis=0) == 0).all(axis=1)
    return int((np.r_[False, same] | np.r_[same, False]).sum())


def _distance_from_base(
    control: Control, choice: Choice, steps: Steps, positions: Positions, bar: _Bar
) -> Float[np.ndarray, " W"]:
    """Return how far each vertex lies from where the base scheme alone would have it."""
    if choice.model is None:
        return np.zeros(len(positions.points))
    asked = control.mesh, named_scheme(steps.base.name), steps
    plain = refine_positions(*asked, limit=choice.limit, progress=bar.within("base"))
    return np.linalg.norm(positions.points - plain.points, axis=1)


def _at_later(values: Float[np.ndarray, " L"], steps: Steps) -> Float[np.ndarray, " W"]:
    """Carry values from the vertices of a level to the last; new ones have a mean."""
    counts = [step.topology.vertex_count for step in steps.steps]
    if len(values) not in counts:
        return values
    later = [step.topology for step in steps.steps[counts.index(len(values)) :]]
    return refine_column(Column(values), later, steps.base)


def _faces(control: Control, steps: Steps, carrier: Carrier) -> Faces:
    final = steps.final
    return Faces(
        starts=final.offsets.astype(np.int64),
        vertices=final.corners.astype(np.int64),
        edges=final.corner_edges.astype(np.int64),
        parents=control.polygons[carrier.face_parents],
    )


def _edge_parents(steps: Steps, snapshot: Snapshot) -> Int[np.ndarray, " E"]:
    """Return the mesh's own edge that each final edge is a piece of; −1 for edges inside faces."""
    first = steps.steps[0].topology
    parents = np.full(len(first.edges), -1, dtype=np.int64)
    # Diagonals that cut polygons into triangles are no edges of the mesh.
    numbers = edge_numbers(first, snapshot.edges)
    own = np.flatnonzero(numbers >= 0)
    parents[numbers[own]] = own
    return edge_parents([step.topology for step in steps.steps], steps.final, parents)


def _final_crease_sharpness(steps: Steps) -> Float[np.ndarray, " E"]:
    """Return what is left of each final edge's sharpness."""
    crease_sharpness = np.zeros(len(steps.final.edges))
    numbers = edge_numbers(steps.final, steps.pairs)
    crease_sharpness[numbers] = steps.crease_sharpness
    return crease_sharpness


@dataclass(frozen=True, eq=False)
class _Carry:
    """Carry a layer's values to the new points, edges, faces or corners."""

    control: Control
    choice: Choice
    steps: Steps
    carrier: Carrier
    edge_parent: Int[np.ndarray, " E"]

    def __call__(self, layer: Layer) -> np.ndarray:
        values: np.ndarray = getattr(self, f"_{layer.domain.name.lower()}")(layer)
        return values

    def _point(self, layer: Layer) -> np.ndarray:
        if layer.rule is Rule.BLEND:
            values = refine_columns(layer.values, self.steps, limit=self.choice.limit)
            return scaled_to_unit(values) if layer.unit else values
        rule = rules.vote if layer.rule is Rule.VOTE else rules.old
        return self.carrier.at_vertices(Column(layer.values, rule))

    def _edge(self, layer: Layer) -> np.ndarray:
        return edge_values(layer, self.edge_parent)

    def _face(self, layer: Layer) -> np.ndarray:
        return layer.values[self.control.polygons][self.carrier.face_parents]

    def _corner(self, layer: Layer) -> np.ndarray:
        values = layer.values[self.control.corners]
        if layer.rule is not Rule.BLEND:
            return self.carrier.at_corners(Column(values, rules.nearest))
        # Directions are stored roughly: what differs by less than that is no seam.
        same = np.round(values, 3) if layer.unit else None
        keep = KEPT[self.choice.uv_smooth] if layer.kind == "FLOAT2" else "boundaries"
        return self.carrier.at_corners(Column(values, rules.smooth, keep, layer.unit, same))


def edge_values(layer: Layer, parents: Int[np.ndarray, " E"]) -> np.ndarray:
    """Return a layer's values at the edges' parents; 0 where an edge has none, −1."""
    if len(layer.values) == 0:
        return np.zeros((len(parents), layer.values.shape[1]), layer.values.dtype)
    return np.where((parents >= 0)[:, None], layer.values[parents], np.zeros_like(layer.values[:1]))


class _Bar:
    """The share of the work that is done, over its stages."""

    def __init__(self, progress: Callable[[float], None]) -> None:
        self._progress, self._share = progress, 0.0
        self._begins = dict(
            zip(SHARES, np.cumsum([0, *SHARES.values()])[:-1].tolist(), strict=True)
        )

    def reach(self, stage: str, share: float = 1.0) -> None:
        self._share = max(self._share, self._begins[stage] + SHARES[stage] * share)
        self._progress(self._share)

    def look_up(self) -> None:
        self._progress(self._share)

    def within(self, stage: str) -> Callable[[int, int], None]:
        return lambda done, total: self.reach(stage, done / max(total, 1))
