"""The formula: what a learned level adds to the base scheme. Read from top to bottom.

Proximity-preserving neural subdivision is a classical step plus a bounded correction δ at each new
vertex (H. Ugail, *Proximity-Preserving Neural Subdivision*). The paper's rule, models of format 1:

    q = q0 + δ        δ = h² γ F η(φ)                  ‖η‖ ≤ C / R                  equation 1

The default's rule, models of format 5, acts at the control mesh alone:

    x = x0 + s δ      δ = γ Π_ρ( D + τ h F z(φ) )      ‖F z‖ ≤ 1,  ρ = C h² / R

    x0 = S p   the base scheme S applied to the control points p
    D          from x0 to flat: to an old vertex itself, an edge's middle, a face's centre
    F          the edge's frame: along it, along the mean normal, across
    φ          features of the edge, or what networks of directed edges heard of its surroundings,
               and z(φ) the answer: the mean over both directions of an edge, over the directed
               edges that leave an old vertex, or a height along the normal of a face
    h          the edge's length; elsewhere the root mean square of the ring's or face's edges
    γ          the gate, 0 on planes, in [0, 1]                                ``directed_gates``
    Π_ρ        shortens to length ρ, whatever the network answers
    s          the fold guard: no child turns by more than θ                       ``guard_scale``

C is the budget, R the mesh's unit of length, τ the share of h that the network may ask for. On a
boundary or a crease there is no network: Π_ρ(D) along the curve (``curves``), so that meshes that
share it still meet there. The networks also answer how sharp edges and vertices are
(``sharpness``): w and κ change the masks of S, and with them the gate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count as rounds_from_0
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.errors import ParameterError
from pns_common.kernels import children, correction, directed, frames, measures
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


# --- the paper's rule ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that surrounds the paper's network at N interior edges.

    Attributes:
        rows: their numbers.
        features: φ, (N, K).
        basis: F as rows T, N, B, (N, 9).
        gate: γ.
        bound: ρ.
        degenerate: where there is no frame.
    """

    rows: Integer[np.ndarray, " N"]
    features: Float[np.ndarray, "N K"]
    basis: Float[np.ndarray, "N 9"]
    gate: Float[np.ndarray, " N"]
    bound: Float[np.ndarray, " N"]
    degenerate: Bool[np.ndarray, " N"]


@dataclass(frozen=True)
class PaperRule:
    """The network and the numbers of the paper's rule; symbols as at the top of this file.

    Attributes:
        network: φ → η, at unit budget.
        seen: the features φ of edges.
        symmetric: c lies to the left of a → b, so no numbering matters; else in the lower face.
        gate_sharpness: c.
        budget: C.
        feature_type: the floating type in which the network reads φ.
    """

    network: Network
    seen: FeatureSet
    symmetric: bool
    gate_sharpness: float
    budget: float
    feature_type: type[np.floating[Any]] = np.float64

    def __call__(self, level: Level) -> Additions:
        """Apply the rule at a level.

        Raises:
            ModelError: an answer of the network is not finite, or has another shape.
        """
        mesh, count = level.topology, len(level.points)
        x = level.base.place(level.points, mesh, level.blocks)  # x0
        level.measure(rings=self.seen.rings)
        delta, (ratio, gate, bound) = np.zeros((len(x), 3)), np.zeros((3, len(x)))

        def correct(begin: int, end: int) -> int:
            at = edge_inputs(level, self, mesh.interior[begin:end])
            read = at.rows, count, answers(self.network, at), at.basis, at.gate, at.bound
            correction.correct_by_equation_1(*read, delta, ratio, gate, bound)
            return int(at.degenerate.sum())

        blocks = level.blocks.of_rows(NETWORK_ROWS)
        degenerate = sum(blocks.run(len(mesh.interior), correct))
        base_points = x.copy()
        x += delta
        return Additions(x, base_points, delta, ratio, gate, bound, None, degenerate, None)


def edge_inputs(level: Level, rule: PaperRule, rows: Integer[np.ndarray, " N"]) -> Inputs:
    """Return what surrounds the paper's network at interior edges: equations 6 to 8."""
    mesh, count, seen = level.topology, len(rows), rule.seen
    basis = np.empty((count, 9))
    features = np.empty((count, seen.count), dtype=rule.feature_type)
    (curvature, length), degenerate = np.empty((2, count)), np.empty(count, bool)
    fields = level.rings.fields if seen.rings else np.zeros((0, measures.FIELDS))
    frames.frames_and_features(
        *(level.points, level.normals, fields, level.edges.lengths, level.logs),
        *(mesh.connectivity, rows, rule.symmetric, seen.starts),
        *(basis, curvature, length, degenerate, features),
    )
    gate = np.tanh(rule.gate_sharpness * curvature**2)
    bound = rule.budget / _unit_length(level) * (length * length)
    return Inputs(rows, features, basis, gate, bound, degenerate)


def answers(network: Network, at: Inputs) -> Float[np.ndarray, "N 3"]:
    """Return the network's answers; 0 where the gate is shut, for which it is not run.

    Raises:
        ModelError: an answer is not finite, or has another shape.
    """
    made, is_open = np.zeros((len(at.rows), 3)), at.gate != 0
    if is_open.all():
        return checked_answers(network, at.features, 3).astype(np.float64)
    if is_open.any():
        made[is_open] = checked_answers(network, at.features[is_open], 3)
    return made


# --- the default's rule ---------------------------------------------------------------------------


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

    def __call__(self, level: Level) -> Additions:
        """Apply the rule at a level.

        Raises:
            ModelError: an answer of a network is not finite, or has another shape.
        """
        mesh, count = level.topology, len(level.points)
        x = level.base.place(level.points, mesh, level.blocks)  # x0
        said, around = answers_of(level, self.networks), surroundings(level, self, x)
        delta, (ratio, gate, bound) = around.flat, np.zeros((3, len(x)))  # D, to become δ
        asked = said.vertices, said.edges, said.faces[:, None] * level.normals[: len(said.faces)]
        firsts = 0, count, count + len(mesh.edges)
        for u, first, rows, open_, longest, h in zip(
            asked, firsts, around.rows, around.gates, around.bounds, around.lengths, strict=True
        ):
            read = rows, first, u, self.network_scale * h, open_, longest
            to = delta, ratio, gate, bound
            level.blocks.run(len(rows), correction.correct_from_flat, *read, *to)
        curves = find_curves(level.points, mesh.without_soft(), len(x))
        if len(curves.new_rows):
            pushes = self.curve_strength * curve_pushes(curves, self.vertex_gate_sharpness)
            longest = self.budget / _unit_length(level) * curves.squares
            read = curves.new_rows, curves.shares, curve_prior(curves, pushes), longest
            correction.add_on_curves(*read, delta, ratio, bound)
        scale = guard_scale(level, x, delta, math.radians(self.fold_angle), curves)
        if (scale < 1).any():
            delta *= scale[:, None]
            ratio *= scale
        x += delta
        frameless = int(np.count_nonzero(level.unmarked.edges.lengths[mesh.interior] == 0))
        movable = level.ringed | curves.movable
        return Additions(x, None, delta, ratio, gate, bound, movable, frameless, scale)


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


def surroundings(
    level: Level, rule: DirectedRule, base_points: Float[np.ndarray, "W 3"]
) -> Surroundings:
    """Return what surrounds the network's answers; ``base_points`` are x0."""
    mesh, seen, points = level.topology, level.unmarked, level.points
    flat = np.empty_like(base_points)
    correction.place_flat(points, mesh.connectivity, level.ringed, base_points, flat)
    lengths, squares = seen.edges.lengths, seen.rings.means[:, measures.SQUARE]
    faces, of_faces = np.arange(mesh.face_count if level.base.polygons else 0), np.zeros(0)
    if len(faces):
        in_faces, first = np.diff(mesh.offsets), len(points) + len(mesh.edges)
        centres = np.add.reduceat(points[mesh.corners], mesh.offsets[:-1]) / in_faces[:, None]
        flat[first:] = centres - base_points[first:]
        around = lengths[mesh.corner_edges] ** 2
        of_faces = np.add.reduceat(around, mesh.offsets[:-1]) / in_faces
    ringed = np.flatnonzero(level.ringed).astype(np.uint32)
    rows = ringed, mesh.interior, faces.astype(np.uint32)
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
    opened, at_vertices, most, least = spread_gates(mesh, of_edges)
    if len(mesh.vertex_sharpness):
        at_vertices *= 1 - np.minimum(mesh.vertex_sharpness, 1.0)  # corners that are named
    second = np.tanh(rule.gate_sharpness * jumps**2)
    bent = 1 - sharpness * (1 - most)
    return at_vertices, second * bent + (1 - second) * least, opened


def spread_gates(
    mesh: Topology, of_edges: Float[np.ndarray, " E"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what ``kernels.directed.spread_gates`` makes of the gates of edges."""
    opened, at_vertices = np.zeros(mesh.face_count), np.zeros(mesh.vertex_count)
    most, least = np.zeros(len(mesh.edges)), np.ones(len(mesh.edges))
    directed.spread_gates(mesh.connectivity, of_edges, opened, at_vertices, most, least)
    return opened, at_vertices, most, least


def _unit_length(level: Level) -> float:
    if not level.reference_length:
        raise ParameterError("reference_length", level.reference_length, expected="R > 0")
    return level.reference_length


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
    faces, cosine = level.base.faces(level.topology, level.blocks.quiet()), math.cos(angle)
    scale, changed = np.ones(len(delta)), EVERYWHERE
    shared = curves.shared if curves.shared.any() else NONE_SHARED
    for rounds in rounds_from_0():
        touched = np.zeros(len(delta), dtype=bool)
        read = faces, base_points, delta, scale, shared, changed, cosine
        level.blocks.quiet().run(len(faces), children.mark_folds, *read, touched)
        rows = np.flatnonzero(touched)
        if len(rows) == 0:
            return scale
        scale[rows] = scale[rows] / 2 if rounds < ROUNDS else 0.0
        changed = touched
    raise AssertionError("a round without folds ends the loop")
