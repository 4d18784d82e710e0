"""Coarse meshes as one disjoint union, with all about their limits that weights do not change."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree
from torch import Tensor

from pns_common import Mesh
from train.connectivity import connect
from train.data.batch import joined_meshes
from train.data.pairs.references import Pair
from train.fitting.learned_level import LearnedLevel, learned_level
from train.fitting.limit_maps import LimitMaps, applied, limit_maps
from train.models.recipe import Recipe

# Levels of Loop between the learned level and the vertices at which the limit is looked at.
FINER = 1

# Meshes stand so far apart that the nearest point of all surfaces is one of a mesh's own.
APART = 16.0

# Points of the surfaces from which the limit is looked at.
SEEN_BACK = 6000

# Levels of Loop between the learned level and the vertices between which bending is measured.
FAIR = 2

# Kinds that are to bend no more than quasi-interpolation makes them: smooth ones, and lathes'.
SMOOTH_KINDS = ("grid", "sphere", "lathe")


@dataclass(frozen=True, eq=False)
class LimitSurface:
    """Limit positions, and unit normals, 0 where the ring is open or flat to a line."""

    points: Float[Tensor, "M 3"]
    normals: Float[Tensor, "M 3"]


@dataclass(frozen=True, eq=False)
class LimitBatch:
    """N coarse meshes with reference length 1, their limit maps, and their surfaces.

    Attributes:
        count: N.
        level: the control meshes, and what surrounds the networks there.
        maps: from what one level makes of them to the limit.
        owner: the mesh of each limit vertex.
        area: each limit vertex's share of its mesh's area, summing to 1 a mesh.
        smooth_area: the same over smooth vertices alone, 0 at others.
        authored: meshes that were made for Loop: fairness alone is asked of them.
        smooth: meshes of SMOOTH_KINDS.
        fair: like `maps`, to a finer level, where bending is measured.
        fair_edges: the edges of its faces whose corners are all smooth.
        fair_edge_owner: the mesh of each of them.
        fair_sides: of each of these faces its three edges.
        fair_owner: the mesh of each of these faces.
        tree: of all surfaces' points.
        points, normals: of all surfaces.
        back: the surfaces' points from which the limit is looked at.
        back_owner: the mesh of each.
    """

    count: int
    level: LearnedLevel
    maps: LimitMaps
    owner: Int[np.ndarray, " M"]
    area: Float[Tensor, " M"]
    smooth_area: Float[Tensor, " M"]
    authored: Bool[Tensor, " N"]
    smooth: Bool[Tensor, " N"]
    fair: LimitMaps
    fair_edges: Int[np.ndarray, "E 2"]
    fair_edge_owner: Int[np.ndarray, " E"]
    fair_sides: Int[np.ndarray, "F 3"]
    fair_owner: Int[np.ndarray, " F"]
    tree: KDTree
    points: Float[np.ndarray, "S 3"]
    normals: Float[np.ndarray, "S 3"]
    back: Int[np.ndarray, " B"]
    back_owner: Int[np.ndarray, " B"]

    def limit(self, points: Float[Tensor, "V 3"]) -> LimitSurface:
        """Return the limit surface of the points that one level has made."""
        return _limit(self.maps, points)

    def fair_limit(self, points: Float[Tensor, "V 3"]) -> LimitSurface:
        """Return the same at the vertices where bending is measured."""
        return _limit(self.fair, points)

    def per_mesh(
        self, values: Float[Tensor, " K"], owner: Int[np.ndarray, " K"]
    ) -> Float[Tensor, " N"]:
        """Return sums over what belongs to each mesh."""
        sums = torch.zeros(self.count, dtype=values.dtype)
        return sums.index_add(0, torch.from_numpy(owner), values)


def _limit(maps: LimitMaps, points: Float[Tensor, "V 3"]) -> LimitSurface:
    across = torch.linalg.cross(applied(maps.tangent, points), applied(maps.cotangent, points))
    length = torch.linalg.vector_norm(across, dim=1, keepdim=True)
    return LimitSurface(applied(maps.position, points), across / length.clamp(min=1e-12))


def limit_batch(pairs: Sequence[Pair], recipe: Recipe, rng: np.random.Generator) -> LimitBatch:
    """Join pairs, each scaled to reference length 1, for a scale-free recipe."""
    shifts = [np.array([APART * index, 0.0, 0.0]) for index in range(len(pairs))]
    sizes = [len(pair.coarse.vertices) for pair in pairs]
    apart = [
        Mesh(pair.coarse.vertices + at, pair.coarse.faces)
        for pair, at in zip(pairs, shifts, strict=True)
    ]
    joined = joined_meshes(apart)
    level = learned_level(joined, recipe)
    control = connect(joined.faces, len(joined.vertices))
    first = connect(control.split().numpy(), len(level.base))
    owner = np.repeat(np.arange(len(pairs)), sizes)
    maps = limit_maps(first, FINER)
    first_owner = np.concatenate([owner, owner[control.edges[:, 0].numpy()]])
    owner = first_owner[maps.ancestor]
    fair = limit_maps(first, FAIR)
    fair_faces = fair.faces[fair.smooth[fair.faces].all(axis=1)]
    fair_edges, fair_sides = _sides(fair_faces)
    fair_owner = first_owner[fair.ancestor]
    kinds = [pair.kind for pair in pairs]
    surface = _joined(pair.surface.points + at for pair, at in zip(pairs, shifts, strict=True))
    from_mesh = np.repeat(np.arange(len(pairs)), [len(pair.surface.points) for pair in pairs])
    back = np.sort(rng.choice(len(surface), min(SEEN_BACK, len(surface)), replace=False))
    area = _vertex_areas(level.base.numpy(), maps)
    return LimitBatch(
        count=len(pairs),
        level=level,
        maps=maps,
        owner=owner,
        area=_shares(area, owner, len(pairs)),
        smooth_area=_shares(np.where(maps.smooth, area, 0.0), owner, len(pairs)),
        authored=torch.tensor([kind == "authored" for kind in kinds]),
        smooth=torch.tensor([kind in SMOOTH_KINDS for kind in kinds]),
        fair=fair,
        fair_edges=fair_edges,
        fair_edge_owner=fair_owner[fair_edges[:, 0]],
        fair_sides=fair_sides,
        fair_owner=fair_owner[fair_faces[:, 0]],
        tree=KDTree(surface),
        points=surface,
        normals=_joined(pair.surface.normals for pair in pairs),
        back=back,
        back_owner=from_mesh[back],
    )


def _sides(
    faces: Int[np.ndarray, "F 3"],
) -> tuple[Int[np.ndarray, "E 2"], Int[np.ndarray, "F 3"]]:
    """Return the edges of faces, and which of them are each face's sides."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, first, number = np.unique(
        sides[:, 0] * (faces.max(initial=0) + 1) + sides[:, 1],
        return_index=True,
        return_inverse=True,
    )
    return sides[first], number.reshape(faces.shape)


def _vertex_areas(points: Float[np.ndarray, "W 3"], maps: LimitMaps) -> Float[np.ndarray, " M"]:
    """Return the area of the limit of some points at each vertex, a third of its faces'."""
    limit = maps.position @ points
    a, b, c = (limit[maps.faces[:, corner]] for corner in range(3))
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(maps.faces.reshape(-1), np.repeat(twice / 6, 3), len(limit))


def _shares(
    area: Float[np.ndarray, " M"], owner: Int[np.ndarray, " M"], count: int
) -> Float[Tensor, " M"]:
    total = np.bincount(owner, area, count)
    return torch.from_numpy(area / np.maximum(total, 1e-300)[owner])


def _joined(arrays: Iterable[np.ndarray]) -> np.ndarray:
    return np.concatenate(list(arrays))
