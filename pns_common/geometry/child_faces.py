"""The faces that a step made: how they stand to each other, and to Loop's."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pns_common.base.arrays import dot, gather
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import CHILDREN, Topology, children_across
from pns_common.geometry.frames import triangle_normals


@dataclass(frozen=True, eq=False)
class ChildAngles:
    """How the faces that a step made stand to each other, and to Loop's.

    Attributes:
        flipped: number of faces whose normal opposes that of their Loop counterpart.
        normal_jump_max: largest angle (radians, 0 … π) between the normals of two faces that share
            an interior edge; faces without area are left out.
    """

    flipped: int
    normal_jump_max: float


@dataclass(frozen=True, eq=False)
class ChildFaces(ChildAngles):
    """The same with their unit ``normals``, 0 where a face has no area."""

    normals: Float[np.ndarray, "F 3"]


def child_faces(
    topology: Topology,
    points: Float[np.ndarray, "V 3"],
    loop_points: Float[np.ndarray, "V 3"] | None,
    blocks: Blocks,
) -> ChildFaces:
    """Look at the faces that ``topology`` was split into.

    ``points`` are old vertices, then edge vertices; ``loop_points`` is where Loop would have put
    them, None if they are there.
    """
    normals = np.empty((len(topology.faces), 4, 3))
    has_area = np.empty((len(topology.faces), 4), dtype=bool)
    flipped = np.zeros(len(topology.faces), dtype=np.int64)
    inside = np.zeros(blocks.count(len(topology.faces)))

    def look_inside(rows: slice) -> None:
        six = np.concatenate(
            [topology.faces[rows], topology.face_edges[rows] + topology.vertex_count], axis=1
        ).T
        corners = [gather(points, vertex) for vertex in six]
        four = [triangle_normals(*(corners[i] for i in child)) for child in CHILDREN]
        for child, normal in enumerate(four):
            normals[rows, child] = normal
            has_area[rows, child] = dot(normal, normal) > 0
        defined = has_area[rows]
        inside[blocks.number(rows, len(topology.faces))] = max(
            _largest_chord(four[3], four[i], defined[:, 3] & defined[:, i]) for i in range(3)
        )
        if loop_points is not None:
            loop_corners = [gather(loop_points, vertex) for vertex in six]
            for child, normal in zip(CHILDREN, four, strict=True):
                counterpart = triangle_normals(*(loop_corners[i] for i in child))
                flipped[rows] += dot(counterpart, normal) < 0

    blocks.run(len(topology.faces), look_inside)
    normals, defined = normals.reshape(-1, 3), has_area.reshape(-1)
    across = np.zeros(blocks.count(len(topology.interior)))

    def look_across(rows: slice) -> None:
        pairs = children_across(topology, topology.interior[rows])
        across[blocks.number(rows, len(topology.interior))] = max(
            _largest_chord(
                gather(normals, left), gather(normals, right), defined[left] & defined[right]
            )
            for left, right in pairs.transpose(0, 2, 1)
        )

    blocks.run(len(topology.interior), look_across)
    chord = max(inside.max(initial=0), across.max(initial=0))
    return ChildFaces(int(flipped.sum()), angle_of_chord(chord), normals)


def angle_of_chord(chord: float) -> float:
    """Return the angle between two unit normals, 0 … π radians, from their squared distance.

    That keeps small angles, which 1 − cos would round away.
    """
    return float(2 * np.arcsin(min(1.0, math.sqrt(chord) / 2)))


def _largest_chord(
    n1: Float[np.ndarray, "N 3"], n2: Float[np.ndarray, "N 3"], defined: Bool[np.ndarray, " N"]
) -> float:
    """Return the largest squared distance between the normals of a pair that both have one."""
    chord = n1 - n2
    return float(np.max(dot(chord, chord), initial=0, where=defined))
