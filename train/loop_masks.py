"""Edges of a triangle mesh and Loop's masks as sparse matrices, differentiable in sharpness.

Written from the paper's equations 2 and 3 and the rules of Hoppe et al. 1994, not from
`pns_common`: tests hold its kernels against these, training takes its limits by them.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import connected_components
from torch import Tensor

EDGE_END, EDGE_OPPOSITE, MIDDLE = 3 / 8, 1 / 8, 1 / 2
CURVE_CENTRE, CURVE_SIDE = 3 / 4, 1 / 8
LIMIT_CENTRE, LIMIT_SIDE = 2 / 3, 1 / 6


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
        ringed: whether all edges of a vertex have two faces, and these make one fan.
    """

    vertex_count: int
    faces: Int[Tensor, "F 3"]
    face_edges: Int[Tensor, "F 3"]
    edges: Int[Tensor, "E 2"]
    half_edges: Int[Tensor, "E 2"]
    sharpness: Float[Tensor, " E"]
    ringed: Bool[Tensor, " V"]

    @property
    def paired(self) -> Bool[Tensor, " E"]:
        """Whether an edge has two faces of opposite direction."""
        return self.half_edges[:, 0] >= 0

    @property
    def opposites(self) -> Int[Tensor, "E 2"]:
        """Vertices c, d that an edge's two faces have on neither end; a where there is none."""
        before = self.half_edges - self.half_edges % 3 + (self.half_edges + 2) % 3
        return torch.where(self.paired[:, None], self.faces.reshape(-1)[before], self.edges[:, :1])

    @property
    def centres(self) -> Int[Tensor, " S"]:
        """Vertices from which spokes 2 e and 2 e + 1 start: both ends of edge e."""
        return self.edges.reshape(-1)

    @property
    def rims(self) -> Int[Tensor, " S"]:
        """Vertices at which spokes end."""
        return self.edges.flip(1).reshape(-1)

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
    half_edges[~paired] = -1
    named = np.zeros((0, 2), dtype=np.int64) if creases is None else np.sort(creases, axis=1)
    is_named = np.isin(sorted_keys[by_number], named[:, 0] * vertex_count + named[:, 1])
    # Corners of a fan are joined across the edges between them.
    here, there = half_edges[paired].T
    after_here, after_there = (corner - corner % 3 + (corner + 1) % 3 for corner in (here, there))
    joins = (np.concatenate([here, after_here]), np.concatenate([after_there, there]))
    joined = sparse.coo_array((np.ones(len(joins[0])), joins), shape=(len(starts), len(starts)))
    _, fan = connected_components(joined, directed=False)
    _, of_fan = np.unique(fan, return_index=True)
    open_ends = np.bincount(edges[~paired].reshape(-1), minlength=vertex_count)
    fans = np.bincount(starts[of_fan], minlength=vertex_count)
    return Connectivity(
        vertex_count,
        torch.from_numpy(faces),
        torch.from_numpy(edge_of.reshape(-1, 3)),
        torch.from_numpy(edges),
        torch.from_numpy(half_edges),
        torch.from_numpy(np.where(is_named | ~paired, 1.0, 0.0)),
        torch.from_numpy((fans == 1) & (open_ends == 0)),
    )


@dataclass(frozen=True, eq=False)
class Mask:
    """A sparse matrix by its entries, differentiable in its weights and in what it is applied to.

    Attributes:
        shape: rows, columns.
        rows, columns, weights: of each entry; entries of one place add up.
    """

    shape: tuple[int, int]
    rows: Int[Tensor, " N"]
    columns: Int[Tensor, " N"]
    weights: Float[Tensor, " N"]

    def __call__(self, points: Float[Tensor, "V K"]) -> Float[Tensor, "W K"]:
        """Apply the mask."""
        made = points.new_zeros((self.shape[0], points.shape[1]))
        return made.index_add(0, self.rows, self.weights[:, None] * points[self.columns])

    def matrix(self) -> sparse.csr_array:
        """Return the mask as a matrix without gradient."""
        place = (self.rows.numpy(), self.columns.numpy())
        return sparse.csr_array((self.weights.detach().numpy(), place), shape=self.shape)


def _mask(
    shape: tuple[int, int], *entries: tuple[Int[Tensor, " N"], Int[Tensor, " N"], Tensor | float]
) -> Mask:
    rows, columns = torch.cat([e[0] for e in entries]), torch.cat([e[1] for e in entries])
    weights = [torch.as_tensor(w, dtype=torch.float64).expand(len(r)) for r, _, w in entries]
    return Mask(shape, rows, columns, torch.cat(weights))


def loop_beta(valence: Int[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Return β_k = (5/8 − (3/8 + ¼ cos 2π/k)²) / k (equation 3); 0 for k = 0."""
    k = valence.clamp(min=1).double()
    beta = (5 / 8 - (3 / 8 + torch.cos(2 * math.pi / k) / 4) ** 2) / k
    return torch.where(valence > 0, beta, 0.0)


def limit_weight(valence: Int[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Return w_k = 1 / (1 + 3 / (8 k β_k)), the neighbours' weight in Loop's limit."""
    ring = valence * loop_beta(valence)
    return ring / (ring + 3 / 8)


def loop_mask(mesh: Connectivity) -> Mask:
    """Return S_w: old vertices first, then a vertex for each edge.

    Edge vertices are (1 − w) smooth + w middle; old ones (1 − w₂) smooth + (w₂ − w₃) curve + w₃ p.
    """
    count, own, beta = mesh.vertex_count, torch.arange(mesh.vertex_count), loop_beta(mesh.valence)
    (_, second, third), rims = mesh.sharpest[0].T, mesh.sharpest[1]
    smooth, curve = 1 - second, second - third
    centre = smooth * (1 - mesh.valence * beta) + curve * CURVE_CENTRE + third
    inserted, w, sides = count + torch.arange(len(mesh.edges)), mesh.sharpness, mesh.opposites
    return _mask(
        (count + len(mesh.edges), count),
        (own, own, centre),
        (mesh.centres, mesh.rims, (smooth * beta)[mesh.centres]),
        *((own, rims[:, side], curve * CURVE_SIDE) for side in (0, 1)),
        *((inserted, mesh.edges[:, k], (1 - w) * EDGE_END + w * MIDDLE) for k in (0, 1)),
        *((inserted, sides[:, k], (1 - w) * EDGE_OPPOSITE) for k in (0, 1)),
    )


def limit_mask(mesh: Connectivity) -> Mask:
    """Return Loop's limit positions, of edges that are smooth (w < ½) or sharp for good."""
    count, own = mesh.vertex_count, torch.arange(mesh.vertex_count)
    sharp = torch.bincount(mesh.edges[mesh.sharpness >= 1 / 2].reshape(-1), minlength=count)
    pull, rims = limit_weight(mesh.valence), mesh.sharpest[1]
    smooth, curve, stays = (kind.double() for kind in (sharp == 0, sharp == 2, sharp > 2))
    share = smooth * pull / mesh.valence.clamp(min=1)
    entries = [(own, own, smooth * (1 - pull) + curve * LIMIT_CENTRE + stays)]
    entries += [(mesh.centres, mesh.rims, share[mesh.centres])]
    entries += [(own, rims[:, side], curve * LIMIT_SIDE) for side in (0, 1)]
    entries += [_dart_limit(mesh, int(dart)) for dart in torch.nonzero(sharp == 1)[:, 0]]
    return _mask((count, count), *entries)


def _dart_limit(mesh: Connectivity, dart: int) -> tuple[Tensor, Tensor, Tensor]:
    """Return the left eigenvector to 1 of the matrix that takes a dart and its spokes to theirs."""
    spokes = torch.nonzero(mesh.centres == dart)[:, 0]
    around = [dart, *mesh.rims[spokes].tolist()]
    place = {vertex: number for number, vertex in enumerate(around)}
    matrix = np.zeros((len(around), len(around)))
    matrix[0, 1:] = loop_beta(torch.tensor([len(spokes)])).item()
    matrix[0, 0] = 1 - matrix[0].sum()
    for row, edge in enumerate((spokes // 2).tolist(), start=1):
        sharp = mesh.sharpness[edge] >= 1 / 2
        matrix[row, [0, row]] = MIDDLE if sharp else EDGE_END
        for side in () if sharp else mesh.opposites[edge].tolist():
            matrix[row, place[side]] += EDGE_OPPOSITE
    # M has rows of sum 1: l (M − 1) = 0 and Σ l = 1.
    system = np.vstack([matrix.T - np.eye(len(around)), np.ones(len(around))])
    weights = np.linalg.lstsq(system, np.eye(len(around) + 1)[-1], rcond=None)[0]
    return torch.full((len(around),), dart), torch.tensor(around), torch.from_numpy(weights)


def tangent_masks(mesh: Connectivity) -> tuple[Mask, Mask]:
    """Return Σ cos(2πj/k) p_j and Σ sin(2πj/k) p_j around ringed vertices, anticlockwise."""
    corners, count = mesh.faces.reshape(-1).numpy(), mesh.vertex_count
    twin = np.full(len(corners), -1)
    here, there = mesh.half_edges[mesh.paired].numpy().T
    twin[here], twin[there] = there, here
    start = np.full(count, -1)
    start[corners] = np.arange(len(corners))
    centres, valence = np.flatnonzero(mesh.ringed.numpy()), mesh.valence.numpy()
    corner, rows, columns, angles = start[centres], [], [], []
    # All rings at once, neighbour by neighbour.
    for turn in range(int(valence[centres].max(initial=0))):
        corner, centres = (part[valence[centres] > turn] for part in (corner, centres))
        rows.append(centres)
        columns.append(corners[corner - corner % 3 + (corner + 1) % 3])
        angles.append(2 * np.pi * turn / valence[centres])
        corner = twin[corner - corner % 3 + (corner + 2) % 3]
    empty = [np.zeros(0, dtype=np.int64)]
    row, column = (torch.from_numpy(np.concatenate(part or empty)) for part in (rows, columns))
    angle = torch.from_numpy(np.concatenate(angles or [np.zeros(0)]))
    shape = (count, count)
    return Mask(shape, row, column, torch.cos(angle)), Mask(shape, row, column, torch.sin(angle))
