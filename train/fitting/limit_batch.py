"""Coarse meshes as one disjoint union, with all about their limits that weights do not change."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

from pns_common.mesh.mesh import fans
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme, in_threes
from train.data.pairs.references import Pair
from train.data.remeshers import with_points
from train.data.sharp_labels import coarse_sharp_edges
from train.fitting.learned_level import LearnedLevel, learned_level, sparse_matrix
from train.fitting.sharp_masks import applied
from train.models.recipe import Recipe

# Meshes stand so far apart that the nearest point of all surfaces is one of a mesh's own.
APART = 16.0

# Faces of the limit from which the surfaces are looked at, and points of these that look back.
SEEN, SEEN_BACK = 4000, 2000


@dataclass(frozen=True, eq=False)
class LimitBatch:
    """N coarse meshes with reference length 1, their limit, and their surfaces.

    Attributes:
        count: N.
        level: the control meshes.
        limit: from the points after two levels to their limit.
        faces: some of the triangles of these, drawn evenly.
        owner: the mesh that each belongs to.
        area: each face's share of its mesh's area, summing to 1 a mesh.
        sharp: which interior edges are sharp in truth.
        edge_owner, edge_share: the mesh of each, and its share of all their turns there.
        tree: of all surfaces' points.
        points, normals: of all surfaces.
        back: the surfaces' points from which the limit is looked at.
        back_owner: the mesh of each.
    """

    count: int
    level: LearnedLevel
    limit: sparse.csr_array
    faces: Int[np.ndarray, "F 3"]
    owner: Int[np.ndarray, " F"]
    area: Float[Tensor, " F"]
    sharp: Float[Tensor, " I"]
    edge_owner: Int[np.ndarray, " I"]
    edge_share: Float[Tensor, " I"]
    tree: KDTree
    points: Float[np.ndarray, "S 3"]
    normals: Float[np.ndarray, "S 3"]
    back: Int[np.ndarray, " B"]
    back_owner: Int[np.ndarray, " B"]

    def per_mesh(
        self, values: Float[Tensor, " K"], owner: Int[np.ndarray, " K"]
    ) -> Float[Tensor, " N"]:
        """Return sums over what belongs to each mesh."""
        sums = torch.zeros(self.count, dtype=values.dtype)
        return sums.index_add(0, torch.from_numpy(owner), values)


def limit_batch(pairs: Sequence[Pair], recipe: Recipe, rng: np.random.Generator) -> LimitBatch:
    """Join pairs, each scaled to reference length 1, for a scale-free recipe."""
    shifts = [np.array([APART * index, 0.0, 0.0]) for index in range(len(pairs))]
    apart = [
        with_points(pair.coarse, pair.coarse.vertices + at)
        for pair, at in zip(pairs, shifts, strict=True)
    ]
    level = learned_level(apart, recipe)
    mesh, base = level.level.topology, level.level.base
    corners = len(mesh.corners)
    for _ in range(2):
        mesh = base.split(mesh, Blocks(), inherit=False)
    limit = limit_matrix(mesh, base)
    faces = mesh.corners[fans(mesh.offsets)[0]].astype(np.int64)
    # Every corner of a control mesh gives as many.
    counts = [len(faces) * len(pair.coarse.corners) // corners for pair in pairs]
    owner = np.repeat(np.arange(len(pairs)), counts)
    seen = np.sort(rng.choice(len(owner), min(SEEN, len(owner)), replace=False))
    faces, owner = faces[seen], owner[seen]
    smooth = level.smooth_sharpness()
    ends = applied(limit, level.second(smooth, level.first(smooth, None))).numpy()
    a, b, c = (ends[faces[:, corner]] for corner in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    surface = _joined(pair.surface.points + at for pair, at in zip(pairs, shifts, strict=True))
    normals = _joined(pair.surface.normals for pair in pairs)
    from_mesh = np.repeat(np.arange(len(pairs)), [len(pair.surface.points) for pair in pairs])
    back = np.sort(rng.choice(len(surface), min(SEEN_BACK, len(surface)), replace=False))
    marks = [coarse_sharp_edges(pair) for pair in pairs]
    edge_owner = np.repeat(np.arange(len(pairs)), [len(edges) for edges in marks])
    interior = level.interior.numpy()
    edge_owner, sharp = edge_owner[interior], _joined(marks)[interior]
    turn = level.psi[:, 0].numpy()
    edge_share = turn / np.maximum(np.bincount(edge_owner, turn), 1e-300)[edge_owner]
    return LimitBatch(
        count=len(pairs),
        level=level,
        limit=limit,
        faces=faces,
        owner=owner,
        area=torch.from_numpy(area / np.maximum(np.bincount(owner, area), 1e-300)[owner]),
        sharp=torch.from_numpy(sharp).double(),
        edge_owner=edge_owner,
        edge_share=torch.from_numpy(edge_share),
        tree=KDTree(surface),
        points=surface,
        normals=normals,
        back=back,
        back_owner=from_mesh[back],
    )


def limit_matrix(topology: Topology, base: BaseScheme) -> sparse.csr_array:
    """Return the masks that put a mesh's vertices on the limit surface."""
    limit = base.limit
    assert limit is not None

    def place(
        values: Float[np.ndarray, "V K"], topology: Topology, blocks: Blocks
    ) -> Float[np.ndarray, "V K"]:
        def masks(three: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "V 3"]:
            return limit.positions(three, topology, blocks)

        return in_threes(values, len(values), masks)

    return sparse_matrix(topology, replace(base, place=place))


def _joined(arrays: Iterable[np.ndarray]) -> np.ndarray:
    return np.concatenate(list(arrays))
