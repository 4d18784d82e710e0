"""The normals of a refined mesh: at rest, and under each of its morph targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from pns_common.fused.where_loaded.grid_points import rounded_rows

from ...course import Course
from ...meshes.barycentric_grid import BarycentricGrid
from ...meshes.split_connectivity import blocks_of
from .control_mesh import ControlMesh
from .skin_and_morph import SkinAndMorph
from .smoothing import NormalGroups, normal_groups

# The share of the work that finding the groups is.
GROUPING = 0.25


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

    def exact(self, group: Int[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
        """Return the normals at rest at vertices of which the groups are given."""
        return np.take(self.rest, group, axis=0)

    def rounded(self, group: Int[np.ndarray, " N"]) -> Float32[np.ndarray, "N 3"]:
        """Return the same in single precision."""
        return rounded_rows(self.rest, group, blocks_of(self.groups.connectivity.grid))

    def under_targets(
        self, group: Int[np.ndarray, " N"]
    ) -> tuple[Float[np.ndarray, "N 3"] | None, ...]:
        """Return those with each morph target at weight 1; None as `morphed` has it."""
        return tuple(
            None if morphed is None else np.take(morphed, group, axis=0) for morphed in self.morphed
        )


def shade(
    control: ControlMesh,
    ids: Sequence[Int[np.ndarray, "F T"]],
    grid: BarycentricGrid,
    points: Float[np.ndarray, "V 3"],
    skin_and_morph: SkinAndMorph,
    limit_normals: Float[np.ndarray, "V 3"] | None,
    course: Course,
) -> Shading | None:
    """Return the normals over refined vertices at `points`; None where no primitive has normals.

    `ids` are, for each primitive, the refined vertices at the grid points of its faces.
    `limit_normals`, where they are wanted, take the place of the faces' own where a vertex has one
    normal alone.
    """
    groups = normal_groups(control, ids, grid)
    if groups is None:
        return None
    poses = 1 + len(skin_and_morph.deltas)
    with course.part(GROUPING, GROUPING + (1 - GROUPING) / poses):
        rest = groups.normals(points, groups.before, course)
        rest = groups.with_own(rest, None)
        if limit_normals is not None:
            rest = groups.with_limit(rest, limit_normals)
    morphed: list[Float[np.ndarray, "G 3"] | None] = []
    with course.part(GROUPING + (1 - GROUPING) / poses, 1.0):
        for target, delta in enumerate(skin_and_morph.deltas):
            with course.part(target / (poses - 1), (target + 1) / (poses - 1)):
                normals = None
                if _bends(control, target):
                    posed = groups.normals(points + delta, lambda: rest, course)
                    normals = groups.with_own(posed, target).astype(np.float32)
                morphed.append(normals)
    return Shading(groups, rest, tuple(morphed))


def _bends(control: ControlMesh, target: int) -> bool:
    return any(
        target < len(primitive.targets) and {"POSITION", "NORMAL"} <= set(primitive.targets[target])
        for primitive in control.primitives
    )
