"""Several steps of the operator on many meshes at once, beside their surfaces at every level."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common.edge_operator import EdgeOperator
from pns_common.linear import level_topologies
from pns_common.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.topology import Topology
from pns_common.vertex_operator import VertexOperator
from train.datasets import Instance
from train.one_step import refine_once
from train.surface_union import SurfaceUnion, surface_union

GEOMETRY = torch.float32
"""Half the memory of double precision; what it rounds is far below what is learned."""


@dataclass(frozen=True, eq=False)
class Level:
    """A refined level of a batch: all that does not depend on where its vertices are.

    Attributes:
        faces: of the refined mesh.
        pairs: the two faces of each interior edge of the refined mesh.
        inserted: vertices of the interior edges of the level before.
        vertex_owner, face_owner, pair_owner: which instance each belongs to.
        at_vertices, at_faces: the surfaces of vertices and of faces.
    """

    faces: Int[np.ndarray, "F 3"]
    pairs: Int[np.ndarray, "P 2"]
    inserted: Int[np.ndarray, " I"]
    vertex_owner: Int[np.ndarray, " V"]
    face_owner: Int[np.ndarray, " F"]
    pair_owner: Int[np.ndarray, " P"]
    at_vertices: SurfaceUnion
    at_faces: SurfaceUnion


@dataclass(frozen=True, eq=False)
class LevelBatch:
    """Coarse meshes of any families as one disjoint union, and its levels.

    Attributes:
        count: how many instances.
        points: coarse vertices.
        topologies: what each step refines.
        levels: what each step makes.
    """

    count: int
    points: Float[Tensor, "V 3"]
    topologies: tuple[Topology, ...]
    levels: tuple[Level, ...]


def level_batch(
    instances: Sequence[Instance], steps: int, device: torch.device | str = "cpu"
) -> LevelBatch:
    """Join instances and prepare so many steps."""
    sizes = [len(instance.mesh.vertices) for instance in instances]
    offsets = np.cumsum([0, *sizes])
    points = np.concatenate([instance.mesh.vertices for instance in instances])
    faces = np.concatenate(
        [one.mesh.faces + start for one, start in zip(instances, offsets[:-1], strict=True)]
    )
    topologies = level_topologies(faces, len(points), steps + 1)
    surfaces = [instance.surface for instance in instances]
    owner, levels = np.repeat(np.arange(len(instances)), sizes), []
    for before, after in pairwise(topologies):
        owner = np.concatenate([owner, owner[before.edges[:, 0]]])
        pairs, face_owner = after.edge_faces[after.interior], owner[after.faces[:, 0]]
        levels.append(
            Level(
                faces=after.faces,
                pairs=pairs,
                inserted=before.vertex_count + before.interior,
                vertex_owner=owner,
                face_owner=face_owner,
                pair_owner=face_owner[pairs[:, 0]],
                at_vertices=surface_union(surfaces, owner, GEOMETRY, device),
                at_faces=surface_union(surfaces, face_owner, GEOMETRY, device),
            )
        )
    return LevelBatch(
        count=len(instances),
        points=torch.from_numpy(points).to(device=device, dtype=GEOMETRY),
        topologies=tuple(topologies[:-1]),
        levels=tuple(levels),
    )


def rollout(
    batch: LevelBatch,
    operator: EdgeOperator,
    budget: float,
    vertex_operator: VertexOperator | None = None,
) -> list[Float[Tensor, "V 3"]]:
    """Return the points after each step of the operator, at reference length 1."""
    points, found = batch.points, []
    for topology in batch.topologies:
        points = refine_once(points, topology, operator, budget, vertex_operator).points
        found.append(points)
    return found


def loop_rollout(batch: LevelBatch) -> list[Float[Tensor, "V 3"]]:
    """Return the points after each step of Loop."""
    points, found = batch.points, []
    for topology in batch.topologies:
        vertices = loop_vertex_vertices(points, topology)
        points = torch.cat([vertices, loop_edge_vertices(points, topology)])
        found.append(points)
    return found
