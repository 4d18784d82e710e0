"""Learned sharpness: how sharp the networks find each edge and vertex of the control mesh.

    w_e = max(0, (γ_e σ_e − ε) / (1 − ε))       γ_e = tanh(c_v x_e),  x_e = 1 − n1 · n2,  ε = 1e-5
    κ_v = max(0, (γ_v σ_v − ε) / (1 − ε))       γ_v as in ``formula``, of smooth edges

σ in [0, 1] are sigmoids of the answers: the mean over both directions of an edge, and over the
directed edges that leave a vertex. The gates keep w = 0 and κ = 0 on planes.

Edges that a user or a file names are not asked about: they have w = 1, as boundaries do. Their
marks change no features, so the edges beside them are found as if nothing were marked.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Integer

from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Mesh, check_is_mesh
from pns_common.model.file import load_model
from pns_common.operator.curves import corner_shares, find_curves
from pns_common.operator.directed import answers_of
from pns_common.operator.formula import DirectedRule, spread_gates
from pns_common.operator.level import Level
from pns_common.operator.scheme import Scheme, loop, pns
from pns_common.parallel import Blocks

# Below 1, since what is marked as sharp for good changes the features of corrections beside it.
SHARPEST = 1 - 2.0**-52
# What is less sharp is smooth: a sigmoid is never 0, and sharp edges cost time at every level.
LEAST_SHARPNESS = 1e-5


def with_sharp_edges(level: Level, creases: Creases, scheme: Scheme) -> Level:
    """Return a level with the edges that are named, and those that are found.

    Raises:
        ParameterError: a named pair is no edge of the mesh.
        ModelError: a network's answer is not finite, or has another shape.
    """
    level = level.with_creases(creases)
    if not (creases.learned and isinstance(scheme.rule, DirectedRule)):
        return level
    made = level.topology.with_sharpness(shares_of_edges(level, scheme.rule))
    return level.with_topology(made.with_soft_corners(shares_of_corners(level, scheme.rule)))


def shares_of_edges(level: Level, rule: DirectedRule) -> Float[np.ndarray, " E"]:
    """Return w of each edge: 0 at edges without two faces, and on planes."""
    answers, seen = answers_of(level, rule.networks), level.unmarked
    gate = np.tanh(rule.vertex_gate_sharpness * seen.edges.jumps)
    return np.minimum(clearly(gate * answers.sharpness), SHARPEST)


def shares_of_corners(level: Level, rule: DirectedRule) -> Float[np.ndarray, " V"]:
    """Return κ of each vertex: inside the network's, 0 on planes; on a boundary its own.

    Where a boundary turns by 45 to 75 degrees κ grows from 0 to 1, whatever lies inside, so that
    pieces that share a boundary keep the same corners.
    """
    answers, seen = answers_of(level, rule.networks), level.unmarked
    mesh = seen.topology
    _, gate, *_ = spread_gates(mesh, np.tanh(rule.vertex_gate_sharpness * seen.edges.jumps))
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

    Example:
        >>> mesh = Mesh(np.eye(4, 3), [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        >>> len(sharp_edges(mesh, angle=60))
        6
    """
    check_is_mesh(mesh)
    if scheme is None:
        scheme = loop() if angle is not None else pns(load_model())
    creases = scheme.creases if angle is None else Creases(angle=angle)
    named = creases_by_name(mesh, creases, scheme)
    pairs = named.sharp_pairs()
    assert pairs is not None
    return pairs
