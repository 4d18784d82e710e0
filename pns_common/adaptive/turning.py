"""Angles by which shading turns over faces.

Six normals of a face are compared: those of the limit surface at its corners, and where the next
level has vertices on its sides. At sharp edges they are those of the face's own side. What the
surface does between is not measured.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Float, Integer

from pns_common.adaptive.parts import CHILDREN, Levels, Part
from pns_common.mesh.rows import dot, marked
from pns_common.schemes.limit import limit_normals


def turns(
    part: Part, finer: Part | None, rows: Integer[np.ndarray, " N"], levels: Levels
) -> Float[np.ndarray, " N"]:
    """Return the largest distance between unit normals of each of some faces: 2 sin(angle / 2).

    The next level is made for these faces alone.

    Args:
        part: the faces.
        finer: the whole next level, where it is made by more than masks.
        rows: which faces, ascending.
        levels: the rules.
    """
    some = marked(rows, part.topology.face_count)
    if finer is not None:
        finer = replace(finer, exists=np.repeat(some, CHILDREN))
    else:
        finer, _, _ = levels.split(part, some, len(part.points))
    children = np.flatnonzero(finer.exists).reshape(-1, CHILDREN)
    normals = _at_corners(finer, levels)[children]
    # Children 0 to 2 begin at a corner of the face; the last one's corners are on its sides.
    return _widest(np.concatenate([normals[:, :3, 0], normals[:, 3]], axis=1))


def chord(degrees: float) -> float:
    """Return the distance between unit vectors that are so far apart."""
    return float(2 * np.sin(np.radians(degrees) / 2))


def degrees(chords: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return angles between unit vectors that are so far apart."""
    return np.degrees(2 * np.arcsin(np.minimum(chords / 2, 1.0)))


def _at_corners(part: Part, levels: Levels) -> Float[np.ndarray, "F 3 3"]:
    """Return the limit normals at corners of faces that exist, each that of its own side."""
    mesh = part.topology
    made, used = np.zeros((len(mesh.corners), 3)), marked(mesh.faces[part.exists], len(part.points))
    for own in levels.settle(part, np.flatnonzero(used)):
        # Where steps lead down, the faces around each vertex became a mesh, that vertex first.
        rows = own.steps[0].vertices[own.rows] if own.steps else own.rows
        at = np.flatnonzero(marked(rows, len(part.points))[mesh.corners])
        sharp = own.topology.with_creases(np.flatnonzero(own.topology.is_sharp))
        found = limit_normals(own.points, sharp, levels.blocks, levels.base)
        corner = np.arange(0, 3 * len(at), 3) if own.steps else at
        made[at] = found.sectors[found.sector_of_corner[corner]]
    return made.reshape(-1, 3, 3)


def _widest(normals: Float[np.ndarray, "N 6 3"]) -> Float[np.ndarray, " N"]:
    """Return the largest distance between any two of the normals that are known, not 0."""
    known, made = (normals != 0).any(axis=2), np.zeros(len(normals))
    for i, j in combinations(range(normals.shape[1]), 2):
        apart = normals[:, i] - normals[:, j]
        made = np.maximum(made, np.where(known[:, i] & known[:, j], dot(apart, apart), 0.0))
    return np.sqrt(made)
