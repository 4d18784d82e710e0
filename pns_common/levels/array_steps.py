"""Level after level with the array kernels, which serve every scheme."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.base.cached import cached_property
from pns_common.connectivity.creases import Creases, crease_children, with_creases
from pns_common.connectivity.topology import (
    EdgeClass,
    Topology,
    build_topology,
    split,
)
from pns_common.geometry.child_faces import ChildFaces, child_faces
from pns_common.geometry.crease_lines import with_crease_lines
from pns_common.geometry.frames import face_normals
from pns_common.levels.step import LevelStep, level_step
from pns_common.masks.crease_shift import crease_shift
from pns_common.rules.control_level import ControlLevel
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class ArrayStep:
    """One step of all rows.

    Attributes:
        control: the points that it split.
        topology: the connectivity that it split, creases marked.
        placed: what the rules placed.
        multi_fan_vertices: of the control mesh the vertices with more than one fan; None later.
        blocks: how row-wise work is divided.
    """

    control: Float[np.ndarray, "V 3"]
    topology: Topology
    placed: LevelStep
    multi_fan_vertices: Bool[np.ndarray, " V"] | None
    blocks: Blocks

    @cached_property
    def faces(self) -> Int[np.ndarray, "C 3"]:
        """The faces that it made."""
        return split(self.topology)

    @cached_property
    def children(self) -> ChildFaces:
        """Their normals, and how they lie to those that they came from."""
        return child_faces(self.topology, self.placed.points, self.placed.loop_points, self.blocks)

    @property
    def crease_shift(self) -> float | None:
        """The longest way from smooth of a vertex at creases; None without creases."""
        topology = self.topology
        shift = crease_shift(
            self.control,
            topology.faces,
            topology.edges,
            topology.half_edges,
            topology.edge_class,
            np.flatnonzero(topology.edge_class == EdgeClass.CREASE),
            self.placed.points,
        )
        return None if shift is None else shift.largest


def array_steps(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Creases,
    scheme: Scheme,
    reference_length: float,
    blocks: Blocks,
) -> Iterator[ArrayStep]:
    """Yield the steps from a control mesh on, without end; overflowing coordinates are not finite.

    Raises:
        ParameterError: a crease is no edge.
        ModelError: the network returned something that is not finite, or of another shape.
    """
    (normals,) = blocks.gather(len(faces), lambda rows: (face_normals(points, faces[rows]),))
    depth = 0
    topology = with_creases(build_topology(faces, len(points)), creases.named)
    topology = with_crease_lines(topology, points, normals, creases)
    while True:
        multi_fan_vertices = topology.multi_fan_vertices if depth == 0 else None
        control = ControlLevel(points, topology, normals, reference_length, blocks, depth)
        # What overflows under an absurd budget is for the caller to find.
        with np.errstate(over="ignore", invalid="ignore"):
            placed = level_step(control, scheme)
        step = ArrayStep(points, topology, placed, multi_fan_vertices, blocks)
        yield step
        points, faces, normals = placed.points, step.faces, step.children.normals
        depth += 1
        plain = build_topology(faces, len(points))
        sharp = creases.sharp_at(depth)
        topology = with_creases(plain, crease_children(topology)) if sharp else plain
