"""The normals of a refined mesh: at rest, and under each of its morph targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from service.gltf.control_mesh import ControlMesh
from service.gltf.followers import Followers
from service.gltf.lattice import Lattice
from service.gltf.normals import safe_unit
from service.gltf.smoothing import NormalGroups, normal_groups


@dataclass(frozen=True, eq=False)
class Shading:
    """Unit normals of the G groups of refined corners.

    Attributes:
        groups: which corners are whose.
        rest: (G, 3) in the base pose.
        morphed: for each morph target with it at weight 1; None where none of its deltas move both
            vertices and normals.
    """

    groups: NormalGroups
    rest: Float[np.ndarray, "G 3"]
    morphed: tuple[Float[np.ndarray, "G 3"] | None, ...]

    def take(
        self, group: Int[np.ndarray, " N"]
    ) -> tuple[Float[np.ndarray, "N 3"], tuple[Float[np.ndarray, "N 3"] | None, ...]]:
        """The normals at rest, and morphed, at vertices of which the groups are given."""
        return self.rest[group], tuple(None if m is None else m[group] for m in self.morphed)


def shade(
    control: ControlMesh,
    ids: Sequence[Int[np.ndarray, "F T"]],
    grid: Lattice,
    points: Float[np.ndarray, "V 3"],
    followers: Followers,
) -> Shading | None:
    """The normals over refined vertices at `points`; None where no primitive has normals.

    `ids` are, for each primitive, the refined vertices at the lattice points of its faces.
    """
    groups = normal_groups(control, ids, grid)
    if groups is None:
        return None
    rest = groups.normals(points, otherwise=safe_unit(groups.before))
    morphed = tuple(
        groups.normals(points + delta, otherwise=rest).astype(np.float32)
        if _bends(control, target)
        else None
        for target, delta in enumerate(followers.deltas)
    )
    return Shading(groups, rest, morphed)


def _bends(control: ControlMesh, target: int) -> bool:
    return any(
        target < len(primitive.targets) and {"POSITION", "NORMAL"} <= set(primitive.targets[target])
        for primitive in control.primitives
    )
