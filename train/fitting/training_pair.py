"""A coarse mesh and its surface: distances and normals over the base scheme's."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

from pns_common import Mesh
from pns_common.mesh.reference_length import measure_reference_length
from train.data.pair_store import StoredPairs
from train.fitting.control_mesh import ControlMesh
from train.models.recipe import DirectedForm
from train.tensors import dot, ratio, root

# Points from which the limit looks at the surface, and the surface at the limit.
SEEN, SEEN_BACK = 2000, 1200

# Candidates among the surface's points, each a disc of this many spacings' radius.
CANDIDATES, DISC = 4, 0.6
SPACING_OF = 200

# Exponents of the means of distances.
POWERS = (1, 2, 8)

# Errors below these (in R; chords of unit normals) are as good as none.
FLOORS = (1e-4, 1e-4, 1e-4, 4e-3)
TINY = 1e-7


@dataclass(frozen=True, eq=False)
class Discs:
    """A surface as discs at its points, at right angles to the normals there."""

    pairs: StoredPairs

    @cached_property
    def tree(self) -> KDTree:
        """Tree of the points."""
        return KDTree(self.pairs.points)

    @cached_property
    def radius(self) -> float:
        """Radius of the discs: of a size with the points' distances."""
        step = max(len(self.pairs.points) // SPACING_OF, 1)
        around = self.tree.query(self.pairs.points[::step], 7)[0]
        return DISC * float(np.median(around[:, -1]))

    def nearest(
        self, points: Float[np.ndarray, "N 3"]
    ) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
        """Return the nearest points of the discs, and their normals."""
        found = self.tree.query(points, CANDIDATES)[1]
        centres, normals = self.pairs.points[found], self.pairs.normals[found]
        away = points[:, None] - centres
        away -= (away * normals).sum(axis=2, keepdims=True) * normals
        length = np.linalg.norm(away, axis=2, keepdims=True)
        onto = centres + away * np.minimum(1, self.radius / np.maximum(length, TINY))
        rows = np.arange(len(points))
        best = ((points[:, None] - onto) ** 2).sum(axis=2).argmin(axis=1)
        return onto[rows, best], normals[rows, best]


class TrainingPair:
    """A coarse mesh, its surface, and what of it does not change in training.

    Attributes:
        kind: of the pair.
    """

    def __init__(self, discs: Discs, number: int, form: DirectedForm):
        mesh, self.kind = discs.pairs.meshes[number], discs.pairs.kinds[number]
        self.scale = 1 / measure_reference_length(mesh.vertices, mesh.corners)
        self.centre = mesh.vertices.mean(axis=0)
        points = (mesh.vertices - self.centre) * self.scale
        self.discs, self.form = discs, form
        self.mesh = Mesh(points, (mesh.corners, mesh.offsets))

    @cached_property
    def control(self) -> ControlMesh:
        """The control mesh, of reference length 1."""
        return ControlMesh(self.mesh, self.form)

    @cached_property
    def reference(self) -> tuple[float, ...]:
        """The base scheme's errors."""
        with torch.no_grad():
            errors = self.errors(self.control.limit(None).points, np.random.default_rng(0))
        return tuple(error.item() for error in errors)

    def forget(self) -> None:
        """Free the memory of what can be made again."""
        vars(self).pop("control", None)

    def ratios(
        self, limit: Float[Tensor, "M 3"], rng: np.random.Generator
    ) -> list[Float[Tensor, ""]]:
        """Return the errors of a limit surface over the base scheme's, floors added to both."""
        reference = self.reference
        errors = self.errors(limit, rng)
        return [
            (error + floor) / (base + floor)
            for error, base, floor in zip(errors, reference, FLOORS, strict=True)
        ]

    def errors(
        self, limit: Float[Tensor, "M 3"], rng: np.random.Generator
    ) -> list[Float[Tensor, ""]]:
        """Return mean, root mean square and 8-norm of distances both ways, and of normals' chords.

        Points are drawn anew each time; the nearest points are held.
        """
        faces = self.control.faces
        corners = limit[torch.from_numpy(faces)]
        a, b, c = corners.unbind(dim=1)
        across = torch.linalg.cross(b - a, c - a)
        twice = root(dot(across, across))
        chosen, weights = _spread(twice.detach().numpy(), rng)
        points = (corners[chosen] * weights[:, :, None]).sum(dim=1)
        onto, normals = self.discs.nearest(points.detach().numpy() / self.scale + self.centre)
        there = _length(points - torch.from_numpy((onto - self.centre) * self.scale))
        own = ratio(across[chosen], twice[chosen][:, None])
        turned = _length(own - torch.from_numpy(normals.astype(np.float64)))
        back = self._back(limit, faces, rng)
        means = [
            (((there**power).mean() + (back**power).mean()) / 2) ** (1 / power) for power in POWERS
        ]
        return [*means, turned.mean()]

    def _back(
        self, limit: Float[Tensor, "M 3"], faces: Int[np.ndarray, "T 3"], rng: np.random.Generator
    ) -> Float[Tensor, " B"]:
        """Return distances of points of the surface from the limit."""
        of_surface = self.discs.pairs.points
        rows = rng.choice(len(of_surface), min(SEEN_BACK, len(of_surface)), replace=False)
        points = (of_surface[rows].astype(np.float64) - self.centre) * self.scale
        held = np.ascontiguousarray(limit.detach().numpy())
        boxes = igl.AABB()
        boxes.init(held, faces)
        face, onto = boxes.squared_distance(held, faces, points)[1:]
        face = np.asarray(face).reshape(-1)
        weights = torch.from_numpy(_barycentric(np.asarray(onto), held[faces[face]]))
        nearest = (limit[torch.from_numpy(faces[face])] * weights[:, :, None]).sum(dim=1)
        return _length(nearest - torch.from_numpy(points))


def _spread(
    twice: Float[np.ndarray, " T"], rng: np.random.Generator
) -> tuple[Int[Tensor, " S"], Float[Tensor, "S 3"]]:
    """Return faces and barycentric coordinates of points spread evenly by area."""
    upto = np.cumsum(twice)
    place = (np.arange(SEEN) + rng.random(SEEN)) / SEEN * upto[-1]
    face = np.searchsorted(upto, place, side="right").clip(max=len(upto) - 1)
    u = rng.random((SEEN, 2))
    u = np.where(u.sum(axis=1, keepdims=True) > 1, 1 - u, u)
    return torch.from_numpy(face), torch.from_numpy(np.c_[1 - u.sum(axis=1), u])


def _barycentric(
    points: Float[np.ndarray, "N 3"], corners: Float[np.ndarray, "N 3 3"]
) -> Float[np.ndarray, "N 3"]:
    """Return weights of corners that give points of their triangles."""
    a, b, c = corners.transpose(1, 0, 2)
    u, v, p = b - a, c - a, points - a
    uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
    pu, pv = (p * u).sum(axis=1), (p * v).sum(axis=1)
    area = np.maximum(uu * vv - uv * uv, np.finfo(float).tiny)
    of_b, of_c = (
        np.clip((vv * pu - uv * pv) / area, 0, 1),
        np.clip((uu * pv - uv * pu) / area, 0, 1),
    )
    return np.c_[1 - of_b - of_c, of_b, of_c]


def _length(vectors: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]:
    return dot(vectors, vectors).clamp(min=TINY**2).sqrt()
