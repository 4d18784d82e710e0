"""Which corners share a normal: those that shared a position and a normal before refinement.

Normals are recomputed from the refined faces; over these groups a hard edge stays hard.

The groups run over all primitives of a mesh, so that a change of material in a smooth surface does
not become an edge in its shading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import dot
from pns_common.base.blocks import BLOCK_ROWS, Blocks, available_threads
from pns_common.base.distinct import number_by_first_appearance
from pns_common.fused.corner_normals import angle_weighted_normals

from ...course import Course
from ...meshes.barycentric_grid import BarycentricGrid
from ...meshes.split_connectivity import SplitConnectivity, split_connectivity
from .control_mesh import ControlMesh, slices
from .normals import safe_unit


@dataclass(frozen=True, eq=False)
class NormalGroups:
    """The G groups of refined corners that share a normal.

    Attributes:
        vertices: (F, T) the refined vertices at the grid points of the faces that have normals.
        connectivity: that of the groups before they were split; their corners are its vertices.
        ids: by primitive the groups of its faces' grid points.
        before: makes the old normals (G, 3), blended linearly: what is left where faces have no
            area.
    """

    vertices: Int[np.ndarray, "F T"]
    connectivity: SplitConnectivity
    ids: dict[int, Int[np.ndarray, "F T"]]
    before: Callable[[], Float[np.ndarray, "G 3"]]

    def normals(
        self,
        points: Float[np.ndarray, "V 3"],
        otherwise: Callable[[], Float[np.ndarray, "G 3"]],
        course: Course,
    ) -> Float[np.ndarray, "G 3"]:
        """Return the groups' unit normals at refined vertices; those of `otherwise` if need be."""
        of_groups, triangles = self.connectivity, self.connectivity.grid.faces
        rows, begun = max(BLOCK_ROWS // len(triangles), 1), course.count(len(self.vertices))
        values = angle_weighted_normals(
            points,
            self.vertices,
            of_groups.ids,
            of_groups.count,
            Blocks(available_threads(), rows, begun),
            triangles,
        )
        # Few have a 0 to begin with.
        undefined = np.flatnonzero(values[:, 0] == 0)
        undefined = undefined[~values[undefined].any(axis=1)]
        if len(undefined):
            values[undefined] = otherwise()[undefined]
        return values

    def with_limit(
        self, values: Float[np.ndarray, "G 3"], limit: Float[np.ndarray, "V 3"]
    ) -> Float[np.ndarray, "G 3"]:
        """Return the limit surface's normals for the groups that are alone at their vertex.

        Where several are (creases), the limit has a normal for each side, and one cannot serve.
        """
        vertex = self.connectivity.at_vertices(self.vertices)
        exact = limit[vertex]
        alone = (np.bincount(vertex, minlength=len(limit))[vertex] == 1) & exact.any(axis=1)
        # A face that is there turned over has the other side.
        side = np.where(dot(exact, values) < 0, -1.0, 1.0)[:, None]
        return np.where(alone[:, None], side * exact, values)


def normal_groups(
    control: ControlMesh, ids: Sequence[Int[np.ndarray, "F T"]], grid: BarycentricGrid
) -> NormalGroups | None:
    """Return the groups over the primitives that have normals; None where none has.

    `ids` are, for each primitive, the refined vertices at the grid points of its faces.
    """
    chosen = [
        number
        for number, primitive in enumerate(control.primitives)
        if "NORMAL" in primitive.attributes and len(ids[number])
    ]
    if not chosen:
        return None
    groups, before = _split_groups(control, chosen, grid)
    shares = slices([len(ids[number]) for number in chosen])
    return NormalGroups(
        vertices=np.concatenate([ids[number] for number in chosen]),
        connectivity=groups,
        ids={number: groups.ids[part] for number, part in zip(chosen, shares, strict=True)},
        before=lambda: safe_unit(groups.linear(before())),
    )


def _split_groups(
    control: ControlMesh, chosen: Sequence[int], grid: BarycentricGrid
) -> tuple[SplitConnectivity, Callable[[], Float[np.ndarray, "C 3"]]]:
    """Split the connectivity of (welded vertex, old normal) pairs; what tells their normals."""
    old = [control.primitives[number].attributes["NORMAL"] for number in chosen]
    starts = slices([len(normals) for normals in old])
    rows = [
        control.primitives[number].corners[control.kept[number]] + part.start
        for number, part in zip(chosen, starts, strict=True)
    ]
    normals, flat = np.concatenate(old), np.concatenate(rows).reshape(-1)
    labels = np.concatenate([control.normal_labels[control.rows[number]] for number in chosen])
    corners, first = number_by_first_appearance(labels[flat])

    def before() -> Float[np.ndarray, "C 3"]:
        values = np.empty((len(first), 3))
        values[corners] = normals[flat]
        return values

    return split_connectivity(corners.reshape(-1, 3), len(first), grid), before
