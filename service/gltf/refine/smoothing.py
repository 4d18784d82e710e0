"""Which corners share a normal: those that shared a position and a normal before refinement.

Normals are recomputed from the refined faces; over these groups a hard edge stays hard. Those that
are their author's own go on.

The groups run over all primitives of a mesh, so that a change of material in a smooth surface does
not become an edge in its shading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import dot, unit
from pns_common.base.blocks import BLOCK_ROWS, Blocks, available_threads
from pns_common.base.distinct import number_by_first_appearance
from pns_common.fused.where_loaded.corner_normals import angle_weighted_normals

from ...course import Course
from ...meshes.barycentric_grid import BarycentricGrid
from ...meshes.split_connectivity import SplitConnectivity, split_connectivity
from .control_mesh import ControlMesh, slices
from .normals import safe_unit
from .own_normals import border_vertices, own_shares, own_shares_at_border


@dataclass(frozen=True, eq=False)
class NormalGroups:
    """The G groups of refined corners that share a normal.

    Attributes:
        vertices: (F, T) the refined vertices at the grid points of the faces that have normals.
        connectivity: that of the groups before they were split; their corners are its vertices.
        ids: by primitive the groups of its faces' grid points.
        given: makes the old normals (C, 3) of the groups before they were split: at rest, for None,
            and under a morph target.
        own: how much of these is their author's; None where nothing is.
    """

    vertices: Int[np.ndarray, "F T"]
    connectivity: SplitConnectivity
    ids: dict[int, Int[np.ndarray, "F T"]]
    given: Callable[[int | None], Float[np.ndarray, "C 3"]]
    own: Float[np.ndarray, " C"] | None

    def before(self) -> Float[np.ndarray, "G 3"]:
        """Return the old normals, blended linearly: what is left where faces have no area."""
        return safe_unit(self.connectivity.linear(self.given(None)))

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

    def with_own(
        self, values: Float[np.ndarray, "G 3"], target: int | None
    ) -> Float[np.ndarray, "G 3"]:
        """Put what is their author's own into normals, at rest (None) or under a morph target."""
        if self.own is None:
            return values
        share = self.connectivity.linear(self.own[:, None])
        rows = np.flatnonzero(share)
        own = self.connectivity.linear(unit(self.given(target)))[rows]
        values[rows] = safe_unit((1 - share[rows]) * values[rows] + share[rows] * own)
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
    corners, given = _corners(control, chosen)
    groups = split_connectivity(corners, int(corners.max()) + 1, grid)
    shares = slices([len(ids[number]) for number in chosen])
    return NormalGroups(
        vertices=np.concatenate([ids[number] for number in chosen]),
        connectivity=groups,
        ids={number: groups.ids[part] for number, part in zip(chosen, shares, strict=True)},
        given=given,
        own=_own(control, chosen, corners, given(None)) if control.authored else None,
    )


def _corners(
    control: ControlMesh, chosen: Sequence[int]
) -> tuple[Int[np.ndarray, "F 3"], Callable[[int | None], Float[np.ndarray, "C 3"]]]:
    """Return the faces over (welded vertex, old normal) pairs, and what tells their normals."""
    old = [control.primitives[number].attributes["NORMAL"] for number in chosen]
    starts = slices([len(normals) for normals in old])
    rows = [
        control.primitives[number].corners[control.kept[number]] + part.start
        for number, part in zip(chosen, starts, strict=True)
    ]
    flat = np.concatenate(rows).reshape(-1)
    labels = np.concatenate([control.normal_labels[control.rows[number]] for number in chosen])
    corners, first = number_by_first_appearance(labels[flat])

    def given(target: int | None) -> Float[np.ndarray, "C 3"]:
        values = np.empty((len(first), 3))
        values[corners] = _normals_under(control, chosen, target)[flat]
        return values

    return corners.reshape(-1, 3), given


def _normals_under(
    control: ControlMesh, chosen: Sequence[int], target: int | None
) -> Float[np.ndarray, "N 3"]:
    """Return the old normals of all rows, at rest or with a morph target at weight 1."""
    parts: list[Float[np.ndarray, "n 3"]] = []
    for number in chosen:
        primitive = control.primitives[number]
        normals = primitive.attributes["NORMAL"]
        # None where nothing moves them.
        moved = None
        if target is not None and target < len(primitive.targets):
            moved = primitive.targets[target].get("NORMAL")
        parts.append(normals if moved is None else normals + moved)
    return np.concatenate(parts)


def _own(
    control: ControlMesh,
    chosen: Sequence[int],
    corners: Int[np.ndarray, "F 3"],
    given: Float[np.ndarray, "C 3"],
) -> Float[np.ndarray, " C"] | None:
    """Return how much of the given normals is their author's own; None where nothing is."""
    ends = slices([len(keep) for keep in control.kept])
    faces = np.concatenate([control.weld.faces[ends[n]][control.kept[n]] for n in chosen])
    blocks = Blocks(available_threads())
    computed = angle_weighted_normals(control.weld.points, faces, corners, len(given), blocks)
    shares = own_shares(given, computed)
    if control.cleaned is not None:
        at_border = np.zeros(len(given), dtype=bool)
        at_border[corners] = border_vertices(control.cleaned.mesh)[
            control.cleaned.vertex_map[faces]
        ]
        shares[at_border] = own_shares_at_border(
            given, computed, control.weld.points, faces, corners, at_border
        )
    return shares if shares.any() else None
