"""Many meshes as one disjoint union, so that a training step is a handful of array operations."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common.connectivity.disjoint_union import disjoint_faces
from pns_common.connectivity.topology import Topology, build_topology, split
from train.data.datasets import Instance
from train.surfaces.implicit import Surface


@dataclass(frozen=True, slots=True)
class Batch:
    """A union of coarse meshes with what the losses need of its refinement.

    Attributes:
        points: coarse vertices, float64.
        topology: of the coarse faces.
        children: faces of the split mesh.
        inserted: the inserted vertex of each interior edge, as an index into the split mesh.
        surface: one surface with the parameters of each inserted vertex's own instance.
        face_pairs: rows of `inserted` whose edges share a coarse face.
    """

    points: Float[Tensor, "V 3"]
    topology: Topology
    children: Int[np.ndarray, "N 3"]
    inserted: Int[np.ndarray, " I"]
    surface: Surface
    face_pairs: Int[np.ndarray, "P 2"]


def disjoint_union(instances: Sequence[Instance]) -> Batch:
    """Join instances of one surface family."""
    meshes = [instance.mesh for instance in instances]
    sizes = [len(mesh.vertices) for mesh in meshes]
    points = np.concatenate([mesh.vertices for mesh in meshes])
    faces = disjoint_faces((mesh.faces, len(mesh.vertices)) for mesh in meshes)
    topology = build_topology(faces, len(points))
    owner = np.repeat(np.arange(len(instances)), sizes)[topology.stencil[topology.interior, 0]]
    return Batch(
        points=torch.from_numpy(points),
        topology=topology,
        children=split(topology),
        inserted=topology.vertex_count + topology.interior,
        surface=_surface_of_each([instance.surface for instance in instances], owner),
        face_pairs=pairs_sharing_a_face(topology),
    )


def pairs_sharing_a_face(topology: Topology) -> Int[np.ndarray, "P 2"]:
    """Return pairs of interior edges of one face, as positions in `topology.interior`."""
    position = np.full(len(topology.edges), -1)
    position[topology.interior] = np.arange(len(topology.interior))
    pairs = position[topology.face_edges[:, [[0, 1], [1, 2], [2, 0]]]].reshape(-1, 2)
    return pairs[(pairs >= 0).all(axis=1)]


def _surface_of_each(surfaces: Sequence[Surface], owner: Int[np.ndarray, " I"]) -> Surface:
    """Return one surface whose parameters are arrays: those of `owner` at each point."""
    first = surfaces[0]
    names = [field.name for field in fields(first)]
    table = np.array([[getattr(surface, name) for name in names] for surface in surfaces])
    columns = torch.from_numpy(table[owner]).unbind(dim=1)
    return replace(first, **dict(zip(names, columns, strict=True)))
