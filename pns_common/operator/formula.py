"""The formula: what a learned level adds to the base scheme. Read from top to bottom.

Proximity-preserving neural subdivision is a classical step plus a bounded correction δ at each new
vertex (H. Ugail, *Proximity-Preserving Neural Subdivision*). The paper's rule, models of format 1:

    q = q0 + δ        δ = h² γ F η(φ)                  ‖η‖ ≤ C / R                  equation 1

The default's rule, models of format 4, acts at the control mesh alone:

    x = x0 + s δ      δ = γ Π_ρ( D + τ ℓ F z(φ) )      ‖z‖ ≤ 1,  ρ = C h² / R

    x0 = S p   the base scheme S applied to the control points p
    D  = S d   the prior: S applied to pushes d that undo the shrinking of S         ``pushes``
    F          the edge's frame; at an old vertex three vectors of its ring; at a face's vertex,
               of which Catmull–Clark's scheme has one for each face, the face's normal alone
    φ          features of the edge, of the ring or the face, and z(φ) the network's answer
    h          the edge's length; elsewhere the root mean square of the ring's or face's edges
    ℓ          h, or less where that is long and thin: at an edge at most the mean altitude of what
               lies across it, at a face its shortest side
    γ          the gate, 0 on planes: γ₂ + (1 − γ₂) γ_f at edges, γ₂ = tanh(c x²), x = 1 − n1 · n2,
               γ_f of the face that is less open; γ_f at a face's vertex: the largest
               (1 − w) tanh(c_v x) over its edges; tanh(c_v x_v) at an old vertex, x_v the mean
               of x over its ring
    Π_ρ        shortens to length ρ, whatever the network answers
    s          the fold guard: no child turns by more than θ                         ``guard_scale``

C is the budget, R the mesh's unit of length, τ the share of ℓ that the network may ask for. On a
boundary or a crease there is no network: δ = Π_ρ(D) along the curve, so that meshes that share it
still meet there. Sharpness w in between blends both: (1 − w) δ + w Π_ρ(D along the curve) at an
edge, and (1 − w₂) δ + (w₂ − w₃) Π_ρ(D along the curve) at an old vertex.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count as rounds_from_0
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.errors import ParameterError
from pns_common.kernels import children, correction, frames, measures, quads
from pns_common.kernels.connectivity import INTERIOR
from pns_common.mesh.topology import Topology
from pns_common.model.features import FeatureSet
from pns_common.operator.curves import Curves, curve_prior, curve_pushes, find_curves
from pns_common.operator.directed import DirectedNetworks, Network, answers_of, checked_answers
from pns_common.operator.level import Level

# Rows of each call of a network: fixed, so that answers do not depend on threads; one chunk.
NETWORK_ROWS = 4096
# After so many halvings s becomes 0.
ROUNDS = 30
EVERYWHERE, NONE_SHARED = np.zeros(0, dtype=bool), np.zeros(0, dtype=bool)


@dataclass(frozen=True)
class Rule:
    """Networks and numbers of a learned rule; symbols as at the top of this file.

    Attributes:
        edge_network: φ → η or z, at unit budget.
        seen: the features φ of edges.
        symmetric: c lies to the left of a → b, so no numbering matters; else in the lower face.
        gate_sharpness: c.
        budget: C.
        vertex_network: the network of old vertices; None leaves them to the base scheme.
        vertex_gate_sharpness: c_v.
        prior_strength: s of d; None for equation 1.
        curve_strength: strength of d on boundaries and creases.
        network_scale: τ.
        fold_angle: θ in degrees, above 0 and below 90; read with a prior alone.
        feature_type: the floating type in which the networks read φ.
        face_network: the network of face vertices, where the base scheme has some; None: z = 0.
        sharpness_network: ψ → sharpness in [0, 1], (N, 1) (sharpness.py); None: none is learned.
    """

    edge_network: Network
    seen: FeatureSet
    symmetric: bool
    gate_sharpness: float
    budget: float
    vertex_network: Network | None = None
    vertex_gate_sharpness: float = 1.0
    prior_strength: float | None = None
    curve_strength: float = 0.0
    network_scale: float = 1.0
    fold_angle: float = 75.0
    feature_type: type[np.floating[Any]] = np.float64
    face_network: Network | None = None
    sharpness_network: Network | None = None


@dataclass(frozen=True, eq=False)
class Additions:
    """Corrections of a level: rows of old vertices, then of edge vertices and face vertices.

    Attributes:
        points: x.
        base_points: x0 where a child may be flipped; None where the guard excludes that.
        displacement: s δ.
        ratio: ‖s δ‖ / ρ ∈ [0, 1]; 0 where ρ is 0.
        gate: γ.
        bound: ρ, 0 where the gate is shut.
        corrected: old vertices that the rule may move; None where it moves none.
        degenerate: number of interior edges without a frame.
        scale: s; None without a guard.
    """

    points: Float[np.ndarray, "W 3"]
    base_points: Float[np.ndarray, "W 3"] | None
    displacement: Float[np.ndarray, "W 3"]
    ratio: Float[np.ndarray, " W"]
    gate: Float[np.ndarray, " W"]
    bound: Float[np.ndarray, " W"]
    corrected: Bool[np.ndarray, " V"] | None
    degenerate: int
    scale: Float[np.ndarray, " W"] | None


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that surrounds a network at N edges, N old vertices, or N faces.

    Attributes:
        rows: their numbers.
        features: φ, (N, K).
        basis: F as rows T, N, B (or the three ring vectors), (N, 9).
        gate: γ.
        bound: ρ.
        reach: τ ℓ.
        weight: 1, less at soft edges, at vertices on soft curves and at corners.
        degenerate: where there is no frame.
    """

    rows: Integer[np.ndarray, " N"]
    features: Float[np.ndarray, "N K"]
    basis: Float[np.ndarray, "N 9"]
    gate: Float[np.ndarray, " N"]
    bound: Float[np.ndarray, " N"]
    reach: Float[np.ndarray, " N"]
    weight: Float[np.ndarray, " N"]
    degenerate: Bool[np.ndarray, " N"]


def learned_level(level: Level, rule: Rule) -> Additions:
    """Apply a rule at a level.

    Raises:
        ModelError: a network's answer is not finite, or has another shape.
    """
    mesh, base, blocks = level.topology, level.base, level.blocks.of_rows(NETWORK_ROWS)
    count, edges = len(level.points), mesh.interior
    x = base.place(level.points, mesh, level.blocks)  # x0
    has_prior = rule.prior_strength is not None
    level.measure(rings=has_prior or rule.seen.rings)
    if not has_prior:
        made = _Rows.starting_with(np.zeros((len(x), 3)))

        def by_equation_1(begin: int, end: int) -> int:
            at = edge_inputs(level, rule, edges[begin:end])
            read = at.rows, count, 0, len(at.rows), answers(rule.edge_network, at), at.basis
            correction.correct_by_equation_1(*read, at.gate, at.bound, *made.arrays)
            return int(at.degenerate.sum())

        degenerate: int = sum(blocks.run(len(edges), by_equation_1))
        base_points = x.copy()
        x += made.displacement
        return Additions(x, base_points, *made.arrays, None, degenerate, None)

    curves, opened = find_curves(level.points, mesh, len(x)), face_gates(level, rule)
    vertices, faces = np.flatnonzero(level.ringed), np.arange(len(x) - count - len(mesh.edges))
    delta, along = prior(level, rule, curves)  # D, to become δ
    made = _Rows.starting_with(delta)

    def at_vertices(begin: int, end: int) -> None:
        at = vertex_inputs(level, rule, vertices[begin:end])
        made.correct(at, answers(rule.vertex_network, at), first=0)

    def at_edges(begin: int, end: int) -> int:
        at = edge_inputs(level, rule, edges[begin:end], opened)
        made.correct(at, answers(rule.edge_network, at), first=count)
        return int(at.degenerate.sum())

    def at_faces(begin: int, end: int) -> None:
        at = face_inputs(level, rule, faces[begin:end], opened)
        made.correct(at, answers(rule.face_network, at, 1), first=count + len(mesh.edges))

    blocks.run(len(vertices), at_vertices)
    blocks.run(len(faces), at_faces)
    degenerate: int = sum(blocks.run(len(edges), at_edges))
    made.add_on_curves(curves, along, budget_per_length(level, rule))
    scale = guard_scale(level, x, delta, math.radians(rule.fold_angle), curves)
    made.scale(scale)
    x += delta
    return Additions(x, None, *made.arrays, level.ringed | curves.movable, degenerate, scale)


@dataclass(frozen=True)
class DirectedRule:
    """Networks of directed edges, and the numbers of their rule.

    Attributes:
        networks: those of a model of format 5.
        gate_sharpness, vertex_gate_sharpness: c and c_v.
        budget: C.
        curve_strength: strength of the prior along boundaries and marked creases.
        network_scale: τ, the longest way that the network may ask for, in edge lengths.
        fold_angle: θ in degrees, above 0 and below 90.
    """

    networks: DirectedNetworks
    gate_sharpness: float
    vertex_gate_sharpness: float
    budget: float
    curve_strength: float
    network_scale: float
    fold_angle: float


@dataclass(frozen=True, eq=False)
class Surroundings:
    """All that surrounds the network's answers at the edges, vertices and faces of a mesh.

    Attributes:
        flat: D of all new vertices, 0 where no network acts.
        gates, bounds, lengths: γ, ρ and h of vertices, edges and faces, each an array.
        rows: those of each at which the network acts.
    """

    flat: Float[np.ndarray, "W 3"]
    gates: tuple[Float[np.ndarray, " _"], ...]
    bounds: tuple[Float[np.ndarray, " _"], ...]
    lengths: tuple[Float[np.ndarray, " _"], ...]
    rows: tuple[Integer[np.ndarray, " _"], ...]


def directed_level(level: Level, rule: DirectedRule) -> Additions:
    """Apply a rule of directed edges at a level.

    Raises:
        ModelError: a network's answer is not finite, or has another shape.
    """
    mesh, base, count = level.topology, level.base, len(level.points)
    x = base.place(level.points, mesh, level.blocks)  # x0
    said, around = answers_of(level, rule.networks), surroundings(level, rule, x)
    delta = around.flat  # D, to become δ
    made = _Rows.starting_with(delta)
    asked = said.vertices, said.edges, along_normals(level, said.faces)
    firsts = 0, count, count + len(mesh.edges)
    for u, first, rows, gate, bound, h in zip(
        asked, firsts, around.rows, around.gates, around.bounds, around.lengths, strict=True
    ):
        read = rows, first, u, rule.network_scale * h, gate, bound

        def correct(begin: int, end: int, read: Any = read) -> None:
            correction.correct_from_flat(*read[:2], begin, end, *read[2:], *made.arrays)

        level.blocks.run(len(rows), correct)
    curves = find_curves(level.points, mesh.without_soft(), len(x))
    along = rule.curve_strength * curve_pushes(curves, rule.vertex_gate_sharpness)
    made.add_on_curves(curves, curve_prior(curves, along), rule.budget / _unit_length(level))
    scale = guard_scale(level, x, delta, math.radians(rule.fold_angle), curves)
    made.scale(scale)
    x += delta
    frameless = int(np.count_nonzero(level.unmarked.edges.lengths[mesh.interior] == 0))
    movable = level.ringed | curves.movable
    return Additions(x, None, *made.arrays, movable, frameless, scale)


def surroundings(
    level: Level, rule: DirectedRule, base_points: Float[np.ndarray, "W 3"]
) -> Surroundings:
    """Return what surrounds the network's answers; ``base_points`` are x0."""
    mesh, seen, points = level.topology, level.unmarked, level.points
    edge_count = len(mesh.edges)
    flat = np.concatenate([points, (points[mesh.edges[:, 0]] + points[mesh.edges[:, 1]]) / 2])
    faces = np.arange(mesh.face_count if level.base.polygons else 0)
    in_faces = np.diff(mesh.offsets)[faces]
    if len(faces):
        centres = np.add.reduceat(points[mesh.corners], mesh.offsets[:-1]) / in_faces[:, None]
        flat = np.concatenate([flat, centres])
    flat -= base_points
    lengths, squares = seen.edges.lengths, seen.rings.means[:, measures.SQUARE]
    of_faces = np.zeros(0)
    if len(faces):
        around = lengths[mesh.corner_edges] ** 2
        of_faces = np.add.reduceat(around, mesh.offsets[:-1]) / in_faces
    ringed = np.flatnonzero(level.ringed).astype(np.uint32)
    rows = ringed, mesh.interior, faces.astype(np.uint32)
    at_rest = np.ones(len(flat), dtype=bool)
    for first, moved in zip((0, len(points), len(points) + edge_count), rows, strict=True):
        at_rest[first + moved] = False
    flat[at_rest] = 0.0
    per_length = rule.budget / _unit_length(level)
    return Surroundings(
        flat,
        directed_gates(mesh, seen.edges.jumps, mesh.sharpness, rule),
        (per_length * squares, per_length * lengths**2, per_length * of_faces),
        (np.sqrt(squares), lengths, np.sqrt(of_faces)),
        rows,
    )


def directed_gates(
    mesh: Topology,
    jumps: Float[np.ndarray, " E"],
    sharpness: Float[np.ndarray, " E"],
    rule: DirectedRule,
) -> tuple[Float[np.ndarray, " V"], Float[np.ndarray, " E"], Float[np.ndarray, " F"]]:
    """Return γ of vertices, edges and faces.

    γ_f = largest (1 − w) tanh(c_v x) over the face's edges; γ_v = largest γ_f around the vertex;
    γ_e = γ₂ (1 − w + w γ_open) + (1 − γ₂) γ_shut, of the face that is more and the one that is
    less open.
    """
    of_edges = (1 - sharpness) * np.tanh(rule.vertex_gate_sharpness * jumps)
    opened = np.maximum.reduceat(of_edges[mesh.corner_edges], mesh.offsets[:-1])
    at_corners = np.repeat(opened, np.diff(mesh.offsets))
    at_vertices = np.zeros(mesh.vertex_count)
    np.maximum.at(at_vertices, mesh.corners, at_corners)
    if len(mesh.vertex_sharpness):
        at_vertices *= 1 - np.minimum(mesh.vertex_sharpness, 1.0)  # corners that are named
    most, least = np.zeros(len(mesh.edges)), np.ones(len(mesh.edges))
    np.maximum.at(most, mesh.corner_edges, at_corners)
    np.minimum.at(least, mesh.corner_edges, at_corners)
    second = np.tanh(rule.gate_sharpness * jumps**2)
    bent = 1 - sharpness * (1 - most)
    return at_vertices, second * bent + (1 - second) * least, opened


def along_normals(level: Level, heights: Float[np.ndarray, " F"]) -> Float[np.ndarray, "F 3"]:
    """Return so long vectors along the normals of faces."""
    return heights[:, None] * level.normals[: len(heights)]


def _unit_length(level: Level) -> float:
    if not level.reference_length:
        raise ParameterError("reference_length", level.reference_length, expected="R > 0")
    return level.reference_length


# --- what surrounds the networks ------------------------------------------------------------------


def prior(
    level: Level, rule: Rule, curves: Curves
) -> tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "M 3"]]:
    """Return D = S d of every new vertex, and D along the curves at those on curves.

    The first is 0 at those that the rule of surfaces does not move.
    """
    d, along = (
        pushes(level, rule),
        rule.curve_strength * curve_pushes(curves, rule.vertex_gate_sharpness),
    )
    made = level.base.place(d + along, level.topology, level.blocks)
    at_rest = np.concatenate([~level.ringed, level.topology.edge_class != INTERIOR])
    made[: len(at_rest)][at_rest] = 0.0
    return made, curve_prior(curves, along)


def pushes(level: Level, rule: Rule) -> Float[np.ndarray, "V 3"]:
    """Return d: how far each vertex is pushed along its normal before S is applied.

    d_v = s ((p − L p)_v · m_v) m_v, L the limit mask of S and m_v the unit normal:
    quasi-interpolation, by strength s. For Loop p − L p = −w_k u_v, u_v the mean of the neighbours
    less p, w_k their weight in L. It is 0 on planes and linear in scale, and 0 on curves, which
    have their own (curves.py).
    """
    rings, made = level.rings, np.empty(level.points.shape)
    limit, smooth = level.base.limit, level.topology.without_creases()
    assert limit is not None
    valences = np.arange(int(rings.valence.max(initial=0)) + 1)
    if limit.ring_weight is not None:
        pull, weight = rings.means, limit.ring_weight(valences)
    else:
        pull, weight = limit.positions(level.points, smooth, level.blocks), np.ones(len(valences))
        pull -= level.points
    read = pull, rings.fields, rings.valence, level.ringed, weight, rule.prior_strength
    level.blocks.run(len(made), lambda begin, end: measures.normal_pushes(*read, begin, end, made))
    sharp = level.topology.sharpest
    if sharp is not None:
        made *= 1 - sharp.weights[:, 1:2]
    return made


def face_gates(level: Level, rule: Rule) -> Float[np.ndarray, " F"]:
    """Return how open each face is: the largest (1 − w) tanh(c_v x) over its edges.

    A flat face whose sides are sharp all around is shut, however it is cut into triangles.
    """
    mesh = level.topology
    of_edges = np.tanh(rule.vertex_gate_sharpness * level.edges.jumps)
    if len(mesh.soft):
        of_edges *= 1 - mesh.soft
    if mesh.triangles:
        first, second, third = of_edges[mesh.face_edges].T
        return np.maximum(np.maximum(first, second), third)
    return np.maximum.reduceat(of_edges[mesh.corner_edges], mesh.offsets[:-1])


def edge_inputs(
    level: Level,
    rule: Rule,
    rows: Integer[np.ndarray, " N"],
    opened: Float[np.ndarray, " F"] | None = None,
) -> Inputs:
    """Return what surrounds the network at interior edges.

    Args:
        level, rule: what they belong to.
        rows: the edges.
        opened: `face_gates`, if they are known already.
    """
    mesh, count, seen = level.topology, len(rows), rule.seen
    basis = np.empty((count, 9))
    features = np.empty((count, seen.count), dtype=rule.feature_type)
    (curvature, sides, length, extent), degenerate = np.empty((4, count)), np.empty(count, bool)
    has_prior = rule.prior_strength is not None
    fields = level.rings.fields if seen.rings else np.zeros((0, measures.FIELDS))
    if opened is None:
        opened = face_gates(level, rule) if has_prior else level.logs[:0]
    measured = level.points, level.normals, fields, level.edges.lengths, level.logs, opened
    to = basis, curvature, sides, length, extent, degenerate, features
    if mesh.triangles:
        of_mesh = mesh.corners, mesh.edges, mesh.corner_edges, mesh.half_edges
        frames.frames_and_features(
            *measured, *of_mesh, rows, 0, count, rule.symmetric, seen.starts, *to
        )
    else:
        of_mesh = mesh.corners, mesh.offsets, mesh.face_of_corner, mesh.edges, mesh.half_edges
        frames.polygon_frames_and_features(*measured, *of_mesh, rows, 0, count, seen.starts, *to)
    gate = np.tanh(rule.gate_sharpness * curvature**2)
    if has_prior:
        # Open on the diagonal of a plane quad too: moving its sides alone would ripple.
        gate += (1 - gate) * sides
    return Inputs(
        rows,
        features,
        basis,
        gate=gate,
        bound=budget_per_length(level, rule) * (length * length),
        reach=rule.network_scale * extent,
        weight=1 - mesh.soft[rows] if len(mesh.soft) else np.ones(count),
        degenerate=degenerate,
    )


def vertex_inputs(level: Level, rule: Rule, rows: Integer[np.ndarray, " N"]) -> Inputs:
    """Return what surrounds the network at old vertices with a closed ring."""
    rings, count, sharp = level.rings, len(rows), level.topology.sharpest
    features, basis = np.empty((count, 10), dtype=rule.feature_type), np.empty((count, 9))
    measures.vertex_features(rings.means, rings.fields, rows, 0, count, features)
    measures.ring_basis(rings.means, rings.fields, rows, 0, count, basis)
    square = rings.means[rows, measures.SQUARE]
    return Inputs(
        rows,
        features,
        basis,
        gate=np.tanh(rule.vertex_gate_sharpness * rings.means[rows, measures.JUMP]),
        bound=budget_per_length(level, rule) * square,
        reach=rule.network_scale * np.sqrt(square),
        weight=1 - sharp.weights[rows, 1] if sharp is not None else np.ones(count),
        degenerate=np.zeros(count, dtype=bool),
    )


def face_inputs(
    level: Level,
    rule: Rule,
    rows: Integer[np.ndarray, " N"],
    opened: Float[np.ndarray, " F"] | None = None,
) -> Inputs:
    """Return what surrounds the network at faces, of gates `opened`; z is along the normal."""
    mesh, count, edges = level.topology, len(rows), level.edges
    made, basis = np.empty((count, frames.FACE_MEASURES)), np.zeros((count, 9))
    of_faces = mesh.corners, mesh.offsets, mesh.corner_edges
    of_edges = edges.lengths, edges.jumps, edges.bends
    frames.measure_face_vertices(
        level.points, level.rings.fields, *of_faces, *of_edges, rows, 0, count, made
    )
    basis[:, :3], square = made[:, :3], made[:, frames.SQUARE]
    return Inputs(
        rows,
        made[:, frames.FACE_FEATURES :].astype(rule.feature_type),
        basis,
        gate=(face_gates(level, rule) if opened is None else opened)[rows],
        bound=budget_per_length(level, rule) * square,
        reach=rule.network_scale * made[:, frames.EXTENT],
        weight=np.ones(count),
        degenerate=np.zeros(count, dtype=bool),
    )


def budget_per_length(level: Level, rule: Rule) -> float:
    """Return C / R."""
    if not level.reference_length:
        raise ParameterError("reference_length", level.reference_length, expected="R > 0")
    return rule.budget / level.reference_length


def answers(network: Network | None, at: Inputs, columns: int = 3) -> Float[np.ndarray, "N 3"]:
    """Return the network's answers; 0 where the gate is shut, for which it is not run.

    It gives so many columns; the others are 0.

    Raises:
        ModelError: an answer is not finite, or has another shape.
    """
    made = np.zeros((len(at.rows), 3))
    is_open = at.gate != 0
    if network is None or not is_open.any():
        return made
    every = is_open.all()
    asked = at.features if every else at.features[is_open]
    rows = slice(None) if every else is_open
    made[rows, :columns] = checked_answers(network, asked, columns)
    return made


# --- the guard ------------------------------------------------------------------------------------


def guard_scale(
    level: Level,
    base_points: Float[np.ndarray, "W 3"],
    delta: Float[np.ndarray, "W 3"],
    angle: float,
    curves: Curves,
) -> Float[np.ndarray, " W"]:
    """Return s ∈ {1, ½, ¼, …, 0} of each new vertex, so that no child folds.

    A child is a triangle, or the triangle at one of the four corners of a quad. While a child of
    x0 + s δ stands at more than ``angle`` (radians, below π/2) to its counterpart in x0, or has
    less than a thousandth of its area, s of its corners is halved, for all such children at once;
    after 30 rounds it becomes 0. The rounds know no order of faces, so the guard does not depend on
    numbering, and a child is tested alone, so it is local. A vertex that a boundary alone places is
    scaled only by children that it would fold by itself: what two meshes share stays shared.

    It bounds the turns between neighbours too. With normals n, n' of two children and m, m' of
    their counterparts, ∠(n, n') ≤ ∠(n, m) + ∠(m, m') + ∠(m', n') ≤ ∠(m, m') + 2 ``angle``.
    """
    mesh = level.topology
    scale, changed = np.ones(len(delta)), EVERYWHERE
    shared = curves.shared if curves.shared.any() else NONE_SHARED
    blocks = level.blocks.quiet()
    mark = quads.mark_folds if level.base.polygons else children.mark_folds
    of_mesh = (
        mesh.corners,
        mesh.offsets,
        mesh.corner_edges,
        mesh.vertex_count,
        mesh.vertex_count + len(mesh.edges),
    )
    if not level.base.polygons:
        of_mesh = mesh.faces, mesh.face_edges, mesh.vertex_count
    for rounds in rounds_from_0():
        touched = np.zeros(len(delta), dtype=bool)
        read = base_points, delta, scale, shared, changed, math.cos(angle)
        blocks.run(
            mesh.face_count,
            lambda begin, end: mark(*read, *of_mesh, begin, end, touched),  # noqa: B023
        )
        rows = np.flatnonzero(touched)
        if len(rows) == 0:
            return scale
        scale[rows] = scale[rows] / 2 if rounds < ROUNDS else 0.0
        changed = touched
    raise AssertionError("a round without folds ends the loop")


@dataclass(frozen=True, eq=False)
class _Rows:
    """Output arrays of a level: δ (at first D), ‖δ‖ / ρ, γ, ρ of every new vertex."""

    displacement: Float[np.ndarray, "W 3"]
    ratio: Float[np.ndarray, " W"]
    gate: Float[np.ndarray, " W"]
    bound: Float[np.ndarray, " W"]

    @classmethod
    def starting_with(cls, prior: Float[np.ndarray, "W 3"]) -> _Rows:
        """Return rows with D, and zeros in the other arrays."""
        return cls(prior, *np.zeros((3, len(prior))))

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """All four, in the order of the kernels."""
        return self.displacement, self.ratio, self.gate, self.bound

    def correct(self, at: Inputs, z: Float[np.ndarray, "N 3"], first: int) -> None:
        """Put δ in place of D at some rows, which count from ``first``."""
        read = at.rows, first, 0, len(at.rows), z, at.basis, at.reach, at.gate, at.bound, at.weight
        correction.correct_by_prior(*read, *self.arrays)

    def add_on_curves(
        self, curves: Curves, along: Float[np.ndarray, "M 3"], budget_per_length: float
    ) -> None:
        """Add Π_ρ(D) along curves, by the share of each new vertex on one."""
        bound = budget_per_length * curves.squares
        read = curves.new_rows, curves.shares, along, bound
        correction.add_on_curves(*read, self.displacement, self.ratio, self.bound)

    def scale(self, by: Float[np.ndarray, " W"]) -> None:
        """Put s δ in place of δ."""
        if (by < 1).any():
            self.displacement[:] *= by[:, None]
            self.ratio[:] *= by
