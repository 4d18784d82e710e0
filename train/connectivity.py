"""Edges of a triangle mesh, found once more: nothing here comes from `pns_common`.

Torch tensors, so that sharpness may keep a gradient. What runs on it is `reference.py`, the masks,
the baselines and the training batches; the library has its own topology.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import connected_components
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Connectivity:
    """Edges of a triangle mesh, in the order of their first appearance.

    Attributes:
        vertex_count: V.
        faces: vertices of each face, anticlockwise from outside.
        face_edges: edges (a, b), (b, c), (c, a) of each face.
        edges: a < b.
        half_edges: corners 3 f + i from which an edge leaves in its two faces, lower face first;
            −1 unless it has exactly two faces that run through it in opposite directions.
        sharpness: w of each edge in [0, 1]; 1 where `half_edges` is −1.
        boundary: whether an edge has one face; with neither one nor `half_edges` it is irregular.
        fans: how many fans the faces around each vertex make.
    """

    vertex_count: int
    faces: Int[Tensor, "F 3"]
    face_edges: Int[Tensor, "F 3"]
    edges: Int[Tensor, "E 2"]
    half_edges: Int[Tensor, "E 2"]
    sharpness: Float[Tensor, " E"]
    boundary: Bool[Tensor, " E"]
    fans: Int[Tensor, " V"]

    @property
    def paired(self) -> Bool[Tensor, " E"]:
        """True for edges with two faces of opposite direction."""
        return self.half_edges[:, 0] >= 0

    @property
    def interior(self) -> Int[Tensor, " I"]:
        """Edges with two faces that are not sharp for good."""
        return torch.nonzero(self.paired & (self.sharpness < 1))[:, 0]

    @property
    def stencil(self) -> Int[Tensor, "E 4"]:
        """Vertices a, b, c, d; c lies in the face of lower index, and a stands for what is not."""
        return torch.cat([self.edges, self.opposites], dim=1)

    @cached_property
    def twins(self) -> Int[Tensor, " H"]:
        """The half-edge on the other side of each; −1 where it is not paired."""
        twins = torch.full((self.faces.numel(),), -1)
        here, there = self.half_edges[self.paired].T
        twins[here], twins[there] = there, here
        return twins

    @property
    def opposites(self) -> Int[Tensor, "E 2"]:
        """Vertices c, d that an edge's two faces have on neither end; a where there is none."""
        across = self.faces.reshape(-1)[next_corner(next_corner(self.half_edges))]
        return torch.where(self.paired[:, None], across, self.edges[:, :1])

    @property
    def centres(self) -> Int[Tensor, " S"]:
        """Vertices from which spokes 2 e and 2 e + 1 start: both ends of edge e."""
        return self.edges.reshape(-1)

    @property
    def rims(self) -> Int[Tensor, " S"]:
        """Vertices at which spokes end."""
        return self.edges.flip(1).reshape(-1)

    @cached_property
    def ringed(self) -> Bool[Tensor, " V"]:
        """True for vertices whose edges all have two faces that make one fan."""
        open_ends = torch.bincount(
            self.edges[~self.paired].reshape(-1), minlength=self.vertex_count
        )
        return (self.fans == 1) & (open_ends == 0)

    @cached_property
    def valence(self) -> Int[Tensor, " V"]:
        """The number of spokes of each vertex."""
        return torch.bincount(self.centres, minlength=self.vertex_count)

    @cached_property
    def sharpest(self) -> tuple[Float[Tensor, "V 3"], Int[Tensor, "V 3"]]:
        """w₁ ≥ w₂ ≥ w₃ around each vertex, and the rims of these spokes; 0 and itself without."""
        weights, centres = self.sharpness.repeat_interleave(2), self.centres.numpy()
        order = np.lexsort((-weights.detach().numpy(), centres))
        rank = np.arange(len(order)) - np.searchsorted(centres[order], centres[order])
        spokes = np.full((self.vertex_count, 3), len(order))
        first = order[rank < 3]
        spokes[centres[first], rank[rank < 3]] = first
        own = torch.arange(self.vertex_count)[:, None]
        table, missing = torch.from_numpy(spokes), torch.from_numpy(spokes == len(order))
        padded = torch.cat([weights, weights.new_zeros(1)])
        return padded[table], torch.where(missing, own, self.rims[table % max(len(order), 1)])

    def split(self) -> Int[Tensor, "C 3"]:
        """Return faces 4 f … 4 f + 3: those at corners a, b, c of face f, and the middle one."""
        (a, b, c), (ab, bc, ca) = self.faces.T, self.face_edges.T + self.vertex_count
        four = ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
        return torch.stack([torch.stack(child, dim=1) for child in four], dim=1).reshape(-1, 3)


Corners = TypeVar("Corners", np.ndarray, Tensor)


def next_corner(corner: Corners) -> Corners:
    """Return the corner after 3 f + i in the same face."""
    return corner - corner % 3 + (corner + 1) % 3


def connect(
    faces: Int[np.ndarray, "F 3"],
    vertex_count: int,
    creases: Int[np.ndarray, "N 2"] | None = None,
) -> Connectivity:
    """Find the edges of a mesh; those that `creases` name by their ends are sharp."""
    faces = np.array(faces, dtype=np.int64)
    starts, ends = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    keys = np.minimum(starts, ends) * vertex_count + np.maximum(starts, ends)
    sorted_keys, first, edge_of, count = np.unique(
        keys, return_index=True, return_inverse=True, return_counts=True
    )
    number = np.argsort(np.argsort(first))
    edge_of, by_number = number[edge_of.reshape(-1)], np.argsort(first)
    edges = np.stack(np.divmod(sorted_keys[by_number], vertex_count), axis=1)
    corners = np.argsort(edge_of, kind="stable")
    one = np.searchsorted(edge_of[corners], np.arange(len(edges)))
    two = np.minimum(one + 1, len(corners) - 1)
    half_edges = np.stack([corners[one], corners[two]], axis=1)
    whole = np.repeat((faces != np.roll(faces, -1, axis=1)).all(axis=1), 3)
    paired = (count[by_number] == 2) & whole[half_edges].all(axis=1)
    paired &= starts[half_edges[:, 0]] == ends[half_edges[:, 1]]
    boundary = (count[by_number] == 1) & whole[half_edges[:, 0]]
    half_edges[~paired] = -1
    named = np.zeros((0, 2), dtype=np.int64) if creases is None else np.sort(creases, axis=1)
    is_named = np.isin(sorted_keys[by_number], named[:, 0] * vertex_count + named[:, 1])
    # Corners of a fan are joined across the edges between them.
    here, there = half_edges[paired].T
    joins = (np.append(here, next_corner(here)), np.append(next_corner(there), there))
    joined = sparse.coo_array((np.ones(len(joins[0])), joins), shape=(len(starts), len(starts)))
    _, fan = connected_components(joined, directed=False)
    _, of_fan = np.unique(fan, return_index=True)
    fans = np.bincount(starts[of_fan], minlength=vertex_count)
    return Connectivity(
        vertex_count,
        torch.from_numpy(faces),
        torch.from_numpy(edge_of.reshape(-1, 3)),
        torch.from_numpy(edges),
        torch.from_numpy(half_edges),
        torch.from_numpy(np.where(is_named | ~paired, 1.0, 0.0)),
        torch.from_numpy(boundary),
        torch.from_numpy(fans),
    )
