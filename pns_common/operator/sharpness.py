"""Learned sharpness: how sharp a network finds each edge of the control mesh.

    w_e = max(0, (γ_e σ_e − ε) / (1 − ε))       γ_e = tanh(c_v x_e),  x_e = 1 − n1 · n2,  ε = 1e-5

σ in [0, 1] is the network's answer to the features ψ_e (``crease-53``, docs/reference): the turn
of the edge, of its wing edges and of what goes on at both ends, and how even and how bent the whole
mesh is. They do not change under motions, scale, mirror, numbering and turning over, and γ keeps
w = 0 on planes. Where the edge's own turn changes its sign the features jump, and γ is 0.

Edges that a user or a file names are not asked about: they have w = 1, as boundaries do. Their
marks change no features, so the edges beside them are found as if nothing were marked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Integer

from pns_common.kernels import sharpness as kernels
from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Mesh, check_is_mesh
from pns_common.mesh.normals import measure_faces
from pns_common.mesh.topology import Topology
from pns_common.model.file import load_model
from pns_common.operator.curves import corner_shares, find_curves
from pns_common.operator.directed import answers_of, checked_answers
from pns_common.operator.formula import (
    NETWORK_ROWS,
    DirectedRule,
    Rule,
    directed_gates,
)
from pns_common.operator.level import Level
from pns_common.operator.scheme import Scheme, loop, pns
from pns_common.parallel import Blocks

# Below 1, since what is marked as sharp for good changes the features of corrections beside it.
SHARPEST = 1 - 2.0**-52
# What is less sharp is smooth: a sigmoid is never 0, and sharp edges cost time at every level.
LEAST_SHARPNESS = 1e-5
# Spread of the edges' lengths, and shares of edges beyond each ramp of turns.
WHOLE = 1 + kernels.STEPS
CREASE_53 = kernels.LOCAL + WHOLE


@dataclass(frozen=True, eq=False)
class TurnedEdges:
    """A mesh without its marks, and what ψ is read from.

    Attributes:
        points, topology: the mesh.
        lengths, jumps, turns: h, x and signed turn of each edge.
        areas: twice the areas of the faces.
        columns: (V, …) of ``kernels.measure_turns``.
        starts, spokes: edges around vertices.
        mean_length: of all edges.
        whole: the columns of ψ that are those of the whole mesh.
    """

    points: Float[np.ndarray, "V 3"]
    topology: Topology
    lengths: Float[np.ndarray, " E"]
    jumps: Float[np.ndarray, " E"]
    turns: Float[np.ndarray, " E"]
    areas: Float[np.ndarray, " F"]
    columns: Float[np.ndarray, "V C"]
    starts: Integer[np.ndarray, " V1"]
    spokes: Integer[np.ndarray, " S"]
    mean_length: float
    whole: Float[np.ndarray, " W"]

    def features(self, rows: Integer[np.ndarray, " N"]) -> Float[np.ndarray, "N 53"]:
        """Return ψ of interior edges."""
        mesh, made = self.topology, np.empty((len(rows), CREASE_53))
        made[:, kernels.LOCAL :] = self.whole
        kernels.edge_features(
            self.points,
            self.lengths,
            self.jumps,
            self.turns,
            self.areas,
            self.columns,
            self.starts,
            self.spokes,
            mesh.corners,
            mesh.offsets,
            mesh.face_of_corner,
            mesh.corner_edges,
            mesh.edges,
            mesh.half_edges,
            mesh.edge_class,
            self.mean_length,
            rows,
            made,
        )
        return made


def sharpness_inputs(
    level: Level, vertex_gate_sharpness: float
) -> tuple[Integer[np.ndarray, " N"], Float[np.ndarray, "N 53"], Float[np.ndarray, " N"]]:
    """Return the edges between two faces, their features ψ, and γ, the most that w can be.

    ``vertex_gate_sharpness`` is c_v.
    """
    seen = turned_edges(level)
    rows = seen.topology.interior
    return rows, seen.features(rows), np.tanh(vertex_gate_sharpness * seen.jumps[rows])


def learned_sharpness(level: Level, rule: Rule) -> Float[np.ndarray, " E"]:
    """Return w of each edge; 0 at edges without two faces, and where the rule has no network.

    Raises:
        ModelError: a network's answer is not finite, or has another shape.
    """
    made, network = np.zeros(len(level.topology.edges)), rule.sharpness_network
    if network is None:
        return made
    seen = turned_edges(level)
    gate = np.tanh(rule.vertex_gate_sharpness * seen.jumps)
    rows = np.flatnonzero(gate).astype(np.uint32)

    def ask(begin: int, end: int) -> None:
        asked = rows[begin:end]
        answers = checked_answers(network, seen.features(asked), 1)
        made[asked] = np.minimum(clearly(gate[asked] * np.clip(answers[:, 0], 0.0, 1.0)), SHARPEST)

    level.blocks.quiet().of_rows(NETWORK_ROWS).run(len(rows), ask)
    return made


def turned_edges(level: Level) -> TurnedEdges:
    """Measure a mesh, as if it had no marks."""
    mesh, blocks = level.topology.without_creases(), level.blocks.quiet()
    areas, measured = level.faces[1], level.with_topology(mesh).edges
    if len(areas) < mesh.face_count:  # not kept
        _, areas = measure_faces(level.points, mesh, blocks, areas=True)
    turns = np.empty(len(mesh.edges))
    blocks.run(
        len(turns),
        lambda begin, end: kernels.signed_turns(measured.jumps, measured.bends, begin, end, turns),
    )
    starts = np.concatenate([[0], np.cumsum(mesh.valence)]).astype(np.int64)
    spokes = np.empty(2 * len(mesh.edges), dtype=np.uint32)
    kernels.find_spokes(mesh.edges, starts[:-1].copy(), spokes)
    columns = np.empty((mesh.vertex_count, kernels.COLUMNS))
    read = turns, measured.lengths, starts, spokes
    blocks.run(len(columns), lambda begin, end: kernels.measure_turns(*read, begin, end, columns))
    mean_length = _mean(measured.lengths)
    return TurnedEdges(
        level.points,
        mesh,
        measured.lengths,
        measured.jumps,
        turns,
        np.ascontiguousarray(areas[:, 3]),
        columns,
        starts,
        spokes,
        mean_length,
        _whole(measured.lengths, mean_length, turns[mesh.interior]),
    )


def _whole(
    lengths: Float[np.ndarray, " E"], mean: float, turns: Float[np.ndarray, " I"]
) -> Float[np.ndarray, " W"]:
    """Return σ / (μ + σ) of the lengths, and the shares of edges that turn beyond each ramp."""
    size = np.abs(turns)
    spread = float(np.sqrt(_mean((lengths - mean) ** 2)))
    shares = [_mean(np.clip((size - low) / (high - low), 0, 1)) for low, high in kernels.RAMPS]
    return np.array([spread / (mean + spread) if mean + spread > 0 else 0.0, *shares])


def _mean(values: Float[np.ndarray, " N"]) -> float:
    return float(values.mean()) if len(values) else 0.0


# --- for whole meshes -----------------------------------------------------------------------------


def with_sharp_edges(level: Level, creases: Creases, scheme: Scheme) -> Level:
    """Return a level with the edges that are named, and those that are found.

    Raises:
        ParameterError: a named pair is no edge of the mesh.
        ModelError: a network's answer is not finite, or has another shape.
    """
    level = level.with_creases(creases)
    if not (creases.learned and scheme.rule):
        return level
    if isinstance(scheme.rule, DirectedRule):
        made = level.topology.with_sharpness(shares_of_edges(level, scheme.rule))
        return level.with_topology(made.with_soft_corners(shares_of_corners(level, scheme.rule)))
    made = level.topology.with_sharpness(learned_sharpness(level, scheme.rule))
    return level.with_topology(made)


def shares_of_edges(level: Level, rule: DirectedRule) -> Float[np.ndarray, " E"]:
    """Return w of each edge: 0 at edges without two faces, and on planes."""
    answers, seen = answers_of(level, rule.networks), level.unmarked
    gate = np.tanh(rule.vertex_gate_sharpness * seen.edges.jumps)
    return np.minimum(clearly(gate * answers.sharpness), SHARPEST)


def shares_of_corners(level: Level, rule: DirectedRule) -> Float[np.ndarray, " V"]:
    """Return κ of each vertex: the network's inside, 0 on planes; on a border the border's own.

    Where a border turns by 60 to 90 degrees κ grows from 0 to 1, whatever lies inside, so that
    pieces that share a border keep the same corners.
    """
    answers, seen = answers_of(level, rule.networks), level.unmarked
    mesh = seen.topology
    smooth = np.zeros(len(mesh.edges))
    gate, _, _ = directed_gates(mesh, seen.edges.jumps, smooth, rule)
    shares = np.minimum(clearly(gate * answers.corners), SHARPEST)
    counts = mesh.sharp_count
    if len(counts):
        shares[counts > 0] = 0.0
        curves = find_curves(level.points, mesh)
        shares[curves.rows] = corner_shares(curves)
    return shares


def clearly(shares: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return shares of which those below LEAST_SHARPNESS are 0, without a jump."""
    return np.maximum(shares - LEAST_SHARPNESS, 0.0) / (1 - LEAST_SHARPNESS)


def creases_by_name(mesh: Mesh, creases: Creases, scheme: Scheme) -> Creases:
    """Return the creases that are named or found, all by name.

    Raises:
        ParameterError: a named pair is no edge of the mesh.
        ModelError: a network's answer is not finite, or has another shape.
    """
    level = Level(mesh.vertices, mesh.topology(), scheme.base, None, Blocks())
    _ = level.unmarked  # where the networks' answers are kept
    topology = with_sharp_edges(level, creases, scheme).topology
    found = np.concatenate([topology.crease_edges, np.flatnonzero(topology.soft)])
    sharpness = topology.sharpness[found] if len(topology.soft) else None
    if creases.wears:
        # Edges that are found stay as sharp as they are.
        wear = topology.wear[found] if len(topology.wear) else np.zeros(len(found))
        lasting = np.where(topology.sharpness[found] < 1, topology.sharpness[found], np.inf)
        sharpness = np.where(wear > 0, wear, lasting)
    edges = topology.edges[found].astype(np.int64)
    corners = None
    if creases.learned and isinstance(scheme.rule, DirectedRule):
        corners = shares_of_corners(level, scheme.rule)
    named = {"named": edges, "sharpness": sharpness, "soft_corners": corners}
    return replace(creases, angle=None, learned=False, **named)


def sharp_edges(
    mesh: Mesh, angle: float | None = None, scheme: Scheme | None = None
) -> Integer[np.ndarray, "N 2"]:
    """Return the edges of a mesh that its shape shows to be sharp, as pairs of vertices.

    Args:
        mesh: a mesh of any polygons.
        angle: edges that turn by more than so many degrees.
        scheme: without an angle: edges to which ``creases="auto"`` of this scheme gives a sharpness
            above ½. None: PNS with the default model.

    Raises:
        ParameterError: it is no Mesh, or the angle is out of range.
        ModelError: a network's answer is not finite, or has another shape.
    """
    check_is_mesh(mesh)
    if scheme is None:
        scheme = loop() if angle is not None else pns(load_model())
    creases = scheme.creases if angle is None else Creases(angle=angle)
    named = creases_by_name(mesh, creases, scheme)
    pairs = named.sharp_pairs()
    assert pairs is not None
    return pairs
