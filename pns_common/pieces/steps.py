"""The steps of a piece through the levels, by compiled kernels or by array kernels: same bits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.base.distinct import first_places
from pns_common.connectivity.creases import Creases
from pns_common.connectivity.topology import Topology
from pns_common.levels.array_steps import array_steps
from pns_common.levels.step import AddedStep
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class Links:
    """What is asked of a level's connectivity beside its step.

    Attributes:
        first, second: of each edge its first half-edge, and its second where it is interior or a
            crease, else −1; half-edge 3 f + i is of face f.
        multi_fan_vertices: of the control mesh the vertices with more than one fan; None later.
    """

    vertex_count: int
    faces: Int[np.ndarray, "F 3"]
    edge_class: Int[np.ndarray, " E"]
    interior: Int[np.ndarray, " I"]
    first: Int[np.ndarray, " E"]
    second: Int[np.ndarray, " E"]
    multi_fan_vertices: Bool[np.ndarray, " V"] | None


@dataclass(frozen=True, eq=False)
class Step:
    """One level of a piece: what it split, what it made.

    Attributes:
        control: the points that it split.
        placed: what the rules placed; None where it is Loop's and was not kept.
        loop: where Loop puts the vertices; None where they are there.
        may_flip: whether a child can have turned over against Loop's.
    """

    links: Links
    control: Float[np.ndarray, "V 3"]
    points: Float[np.ndarray, "W 3"]
    children: Int[np.ndarray, "C 3"]
    placed: AddedStep | None
    loop: Float[np.ndarray, "W 3"] | None
    may_flip: bool


def steps_by_arrays(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Creases,
    scheme: Scheme,
    length: float,
    blocks: Blocks,
) -> Iterator[Step]:
    """Yield the steps of ``array_steps``, with what is asked of them here."""
    for step in array_steps(points, faces, creases, scheme, length, blocks):
        links, loop = _links(step.topology, step.multi_fan_vertices), step.placed.loop_points
        kept = step.placed if step.placed.learned else None
        yield Step(
            links, step.control, step.placed.points, step.faces, kept, loop, loop is not None
        )


def steps_by_kernels(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Creases,
    scheme: Scheme,
    length: float,
    blocks: Blocks,
) -> Iterator[Step]:
    """Yield the same from compiled kernels, which must know the scheme (``fused.known``)."""
    from pns_common.fused.learned.learned_step import learned_points
    from pns_common.fused.levels.level import control_level, next_level
    from pns_common.fused.levels.loop_points import loop_points
    from pns_common.fused.levels.mesh_edges import split_mesh_faces

    level, depth = control_level(points, faces, creases, blocks), 0
    while True:
        mesh = level.mesh
        placed, loop, may_flip = None, None, False
        if not scheme.acts_at(depth):
            level.faces.forget()
            made = loop_points(level.points, mesh, blocks)
        else:
            with np.errstate(over="ignore", invalid="ignore"):
                learned = learned_points(level, scheme, length, blocks)
            made, placed = learned.points, learned.step
            may_flip = learned.counterpart is not None
            loop = learned.counterpart
            if loop is None:
                # The step has added to them in their place.
                loop = loop_points(level.points, mesh, blocks)
        links = Links(
            vertex_count=mesh.vertex_count,
            faces=mesh.faces,
            edge_class=mesh.edge_class,
            interior=mesh.interior,
            first=mesh.half_edges[:, 0],
            second=mesh.half_edges[:, 1],
            multi_fan_vertices=level.multi_fan_vertices if depth == 0 else None,
        )
        children = split_mesh_faces(mesh, np.int32, blocks)
        yield Step(links, level.points, made, children, placed, loop, may_flip)
        depth += 1
        level = next_level(level, made, blocks, sharp=creases.sharp_at(depth))


def _links(topology: Topology, multi_fan_vertices: Bool[np.ndarray, " V"] | None) -> Links:
    return Links(
        vertex_count=topology.vertex_count,
        faces=topology.faces,
        edge_class=topology.edge_class,
        interior=topology.interior,
        first=first_places(topology.face_edges.reshape(-1), len(topology.edges)),
        second=topology.half_edges[:, 1],
        multi_fan_vertices=multi_fan_vertices,
    )
