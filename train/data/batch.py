"""Many meshes as one disjoint union, so that a training step is a handful of array operations."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import Mesh
from train.connectivity import Connectivity, connect
from train.data.datasets import Instance
from train.surfaces.implicit import Surface


@dataclass(frozen=True, slots=True)
class Batch:
    """A union of coarse meshes with what the losses need of its refinement.

    Attributes:
        points: coarse vertices, float64.
        mesh: their connectivity.
        children: faces of the split mesh.
        inserted: the inserted vertex of each interior edge, as an index into the split mesh.
        surface: one surface with the parameters of each inserted vertex's own instance.
        face_pairs: rows of `inserted` whose edges share a coarse face.
    """

    points: Float[Tensor, "V 3"]
    mesh: Connectivity
    children: Int[Tensor, "N 3"]
    inserted: Int[Tensor, " I"]
    surface: Surface
    face_pairs: Int[Tensor, "P 2"]


def disjoint_union(instances: Sequence[Instance]) -> Batch:
    """Join instances of one surface family."""
    joined = joined_meshes([instance.mesh for instance in instances])
    sizes = [len(instance.mesh.vertices) for instance in instances]
    mesh = connect(joined.faces, len(joined.vertices))
    owner = np.repeat(np.arange(len(instances)), sizes)[mesh.edges[mesh.interior, 0].numpy()]
    return Batch(
        points=torch.tensor(joined.vertices),
        mesh=mesh,
        children=mesh.split(),
        inserted=mesh.vertex_count + mesh.interior,
        surface=_surface_of_each([instance.surface for instance in instances], owner),
        face_pairs=pairs_sharing_a_face(mesh),
    )


def joined_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Return meshes side by side as one, in their order."""
    counts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    corners = [mesh.corners + first for mesh, first in zip(meshes, counts[:-1], strict=True)]
    degrees = np.concatenate([np.diff(mesh.offsets) for mesh in meshes])
    faces = np.concatenate(corners), np.append(0, np.cumsum(degrees))
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces)


def pairs_sharing_a_face(mesh: Connectivity) -> Int[Tensor, "P 2"]:
    """Return pairs of interior edges of one face, as positions in `mesh.interior`."""
    position = torch.full((len(mesh.edges),), -1)
    position[mesh.interior] = torch.arange(len(mesh.interior))
    pairs = position[mesh.face_edges[:, [[0, 1], [1, 2], [2, 0]]]].reshape(-1, 2)
    return pairs[(pairs >= 0).all(dim=1)]


def _surface_of_each(surfaces: Sequence[Surface], owner: Int[np.ndarray, " I"]) -> Surface:
    """Return one surface whose parameters are arrays: those of `owner` at each point."""
    first = surfaces[0]
    names = [field.name for field in fields(first)]
    table = np.array([[getattr(surface, name) for name in names] for surface in surfaces])
    columns = torch.from_numpy(table[owner]).unbind(dim=1)
    return replace(first, **dict(zip(names, columns, strict=True)))
