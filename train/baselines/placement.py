"""Steps of baselines, measured against the base scheme as PNS is."""

import numpy as np
from jaxtyping import Float, Int

from pns_common.kernels.connectivity import INTERIOR
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.refining import additions

# The C of the envelope that methods without a budget are measured against.
COMPARED_BUDGET = 0.5


def placed_edges(
    level: Level,
    edges: Float[np.ndarray, "E 3"],
    vertices: Float[np.ndarray, "V 3"] | None = None,
    gate: Float[np.ndarray, " E"] | None = None,
) -> Additions:
    """Return the step to given positions; the envelope is C h² / R of interior edges alone.

    Old vertices without a position are the base scheme's.
    """
    assert level.reference_length is not None  # the library measures it for every rule
    base = level.base.place(level.points, level.topology, level.blocks)
    placed = np.concatenate([base[: len(level.points)] if vertices is None else vertices, edges])
    square = np.where(level.topology.edge_class == INTERIOR, level.edges.lengths**2, 0.0)
    none = np.zeros(len(level.points))
    envelope = np.concatenate([none, COMPARED_BUDGET / level.reference_length * square])
    gates = np.concatenate([none, 0 * square if gate is None else gate])
    return additions(level, placed - base, envelope, gates)


def edges_of(level: Level) -> Int[np.ndarray, "E 2"]:
    """Return the ends of every edge, as numbers that can be subtracted."""
    return level.topology.edges.astype(np.int64)


def midpoints(level: Level) -> Float[np.ndarray, "E 3"]:
    """Return the midpoint of every edge."""
    return level.points[edges_of(level)].mean(axis=1)


def vertex_normals(level: Level) -> Float[np.ndarray, "V 3"]:
    """Return unit normals of vertices, faces weighed by area; 0 where these cancel."""
    normals = level.rings.fields[:, :3]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0, length, 1.0)


def edge_normals(level: Level) -> Float[np.ndarray, "E 3"]:
    """Return at interior edges the unit mean normal of both faces; 0 where there is none."""
    topology = level.topology
    faces = topology.face_of(np.maximum(topology.half_edges, 0))
    known = (topology.edge_class == INTERIOR)[:, None, None]
    both = np.where(known, level.normals[faces], 0.0)
    # Of a face without area, and of antiparallel ones, nothing is known.
    whole = (both**2).sum(axis=2).all(axis=1)[:, None]
    summed = np.where(whole, both.sum(axis=1), 0.0)
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    return summed / np.where(length > np.sqrt(2e-6), length, np.inf)
