"""Normals of refined meshes, computed from the refined faces.

Corners that shared a position and a normal before refinement share one after it, so hard edges stay
hard. The groups span all primitives of a mesh: a change of material in a smooth surface makes no
edge in its shading. Normals that no average of faces explains are their author's own and are
interpolated: foliage lit like the ball that it fills, a bevel shaded like the plane beside it, a
border that another mesh continues.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from pns_common.carry.rows import rounded_rows
from pns_common.mesh.normals import ONE_TRIANGLE, angle_weighted_normals
from pns_common.mesh.rows import cross, dot, marked, norm, number_by_first_appearance, unit
from pns_common.mesh.topology import EdgeClass, Topology
from pns_common.parallel import Blocks, available_threads, no_progress

from ...stages import Stages
from .control_mesh import ControlMesh, slices
from .skin import SkinAndMorph
from .split import Rows, Split

# Share of the progress that finding groups takes.
GROUPING = 0.25
# Triangles in a block of work.
BLOCK_TRIANGLES = 8192
# A sum of unit normals times angles below this has no direction.
NO_DIRECTION = 1e-9
# Cosines of the angles from given to computed normals up to which nothing is the author's own, and
# from which everything is. Exporters average the normals of faces by angle, by area or alike: on
# real meshes 9 of 10 averages lie within 10° of each other, 99 of 100 within 17°. At borders a
# normal is compared with each of these averages, so a degree suffices.
INSIDE, AT_BORDER = np.cos(np.radians([[10.0, 20.0], [1.0, 2.0]]))


def safe_unit(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Return vectors of length 1; the z axis in place of vectors without direction."""
    return np.where((norm(vectors) > NO_DIRECTION)[:, None], unit(vectors), [0.0, 0.0, 1.0])


def corner_normals(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F T"],
    groups: Int[np.ndarray, "F T"],
    count: int,
    triangles: Int[np.ndarray, "D 3"] = ONE_TRIANGLE,
    before: Callable[[int], None] = no_progress,
) -> Float[np.ndarray, "G 3"]:
    """Return the unit normal of each group of corners: the angle-weighted sum of face normals.

    Each face has T points and consists of D `triangles` of them. Groups without area have zeros.
    `before` is called with the number of faces of each block of work.
    """
    rows = max(BLOCK_TRIANGLES // len(triangles), 1)
    blocks = Blocks(available_threads(), before, rows)
    return angle_weighted_normals(points, faces, groups, count, blocks, triangles)


# The normals of the file, at rest (None) or under a morph target.
Given = Callable[[int | None], Float[np.ndarray, "C 3"]]


@dataclass(frozen=True, eq=False)
class NormalGroups:
    """The groups of refined corners that share a normal.

    Attributes:
        split: what the faces with normals were split into.
        rows: the groups that the C groups before refinement become.
        places: for each primitive, its corners of the split.
        given: returns the normals (C, 3) of the file, at rest (None) or under a morph target.
        own: share of these that is their author's own; None if nothing is.
    """

    split: Split
    rows: Rows
    places: dict[int, slice]
    given: Given
    own: Float[np.ndarray, " C"] | None

    def before(self) -> Float[np.ndarray, "G 3"]:
        """Return the file's normals, interpolated linearly: for faces without area."""
        return safe_unit(self.rows.values.linear(self.given(None)))

    def normals(
        self,
        points: Float[np.ndarray, "V 3"],
        otherwise: Callable[[], Float[np.ndarray, "G 3"]],
        stages: Stages,
    ) -> Float[np.ndarray, "G 3"]:
        """Return unit normals of the groups; those of `otherwise` where faces have no area."""
        faces, groups = (self.split.wholes(at) for at in (self.split.vertices, self.rows.at))
        triangles, told = np.arange(faces.shape[1]).reshape(-1, 3), stages.count(len(faces))
        values = corner_normals(points, faces, groups, len(self.rows.place), triangles, told)
        # A first look at one column is cheap.
        undefined = np.flatnonzero(values[:, 0] == 0)
        undefined = undefined[~values[undefined].any(axis=1)]
        if len(undefined):
            values[undefined] = otherwise()[undefined]
        return values

    def with_own(
        self, values: Float[np.ndarray, "G 3"], target: int | None
    ) -> Float[np.ndarray, "G 3"]:
        """Blend the author's own normals into others, at rest (None) or under a morph target."""
        if self.own is None:
            return values
        share = self.rows.values.linear(self.own[:, None])
        rows = np.flatnonzero(share)
        own = self.rows.values.linear(unit(self.given(target)))[rows]
        values[rows] = safe_unit((1 - share[rows]) * values[rows] + share[rows] * own)
        return values

    def with_limit(
        self, values: Float[np.ndarray, "G 3"], limit: Float[np.ndarray, "V 3"]
    ) -> Float[np.ndarray, "G 3"]:
        """Return the limit surface's normals for groups that are alone at their vertex.

        On a crease the limit surface has a normal for each side.
        """
        vertex = self.split.vertices[self.rows.place]
        exact = limit[vertex]
        alone = (np.bincount(vertex, minlength=len(limit))[vertex] == 1) & exact.any(axis=1)
        # A reversed copy of a face shows the other side.
        side = np.where(dot(exact, values) < 0, -1.0, 1.0)[:, None]
        return np.where(alone[:, None], side * exact, values)


def normal_groups(control: ControlMesh, split: Split) -> NormalGroups | None:
    """Return the groups of the primitives with normals; None if none has."""
    shares = control.shares
    chosen = [
        number
        for number, primitive in enumerate(control.primitives)
        if "NORMAL" in primitive.attributes and shares[number].stop > shares[number].start
    ]
    if not chosen:
        return None
    starts = slices([len(control.primitives[number].attributes["NORMAL"]) for number in chosen])
    rows = [control.rows_at_corners(n) + s.start for n, s in zip(chosen, starts, strict=True)]
    flat = np.concatenate(rows)
    labels = np.concatenate([control.normal_labels[control.rows[number]] for number in chosen])
    corners, first = number_by_first_appearance(labels[flat])

    def given(target: int | None) -> Float[np.ndarray, "C 3"]:
        values = np.empty((len(first), 3))
        values[corners] = _normals_under(control, chosen, target)[flat]
        return values

    own = _own(control, chosen, labels)
    part = split.part(*(shares[number] for number in chosen))
    places = slices([len(split.part(shares[number]).vertices) for number in chosen])
    return NormalGroups(
        split=part,
        rows=part.rows(corners),
        places=dict(zip(chosen, places, strict=True)),
        given=given,
        own=None if own is None else own[flat[first]],
    )


def _normals_under(
    control: ControlMesh, chosen: Sequence[int], target: int | None
) -> Float[np.ndarray, "N 3"]:
    """Return the file's normals of all rows, at rest or with a morph target at weight 1."""
    parts: list[Float[np.ndarray, "n 3"]] = []
    for number in chosen:
        primitive = control.primitives[number]
        normals = primitive.attributes["NORMAL"]
        moved = None
        if target is not None and target < len(primitive.targets):
            moved = primitive.targets[target].get("NORMAL")
        parts.append(normals if moved is None else normals + moved)
    return np.concatenate(parts)


def _own(
    control: ControlMesh, chosen: Sequence[int], labels: Int[np.ndarray, " N"]
) -> Float[np.ndarray, " N"] | None:
    """Return the share of each row's normal that is its author's own; None if nothing is."""
    if not control.authored:
        return None
    ends, points = slices([len(keep) for keep in control.kept]), control.weld.points
    faces = np.concatenate([control.weld.faces[ends[n]][control.kept[n]] for n in chosen])
    starts = slices([len(control.primitives[n].attributes["NORMAL"]) for n in chosen])
    rows = np.concatenate(
        [
            control.primitives[n].corners[control.kept[n]] + own.start
            for n, own in zip(chosen, starts, strict=True)
        ]
    )
    corners = number_by_first_appearance(labels[rows.reshape(-1)])[0].reshape(-1, 3)
    given = np.empty((int(corners.max()) + 1, 3))
    given[corners] = _normals_under(control, chosen, None)[rows]
    computed = corner_normals(points, faces, corners, len(given))
    shares = own_shares(given, computed)
    at_border = np.zeros(len(given), dtype=bool)
    of_vertex = border_vertices(control.mesh.topology())
    at_border[corners] = of_vertex[control.cleaned.vertex_map[faces]]
    shares[at_border] = _own_shares_at_border(given, computed, points, faces, corners, at_border)
    if not shares.any():
        return None
    of_rows = np.zeros(starts[-1].stop)
    of_rows[rows] = shares[corners]
    return of_rows


def own_shares(
    given: Float[np.ndarray, "C 3"],
    computed: Float[np.ndarray, "C 3"],
    limits: Float[np.ndarray, " 2"] = INSIDE,
) -> Float[np.ndarray, " C"]:
    """Return the share of each given normal that is its author's own: 0 to 1.

    `computed` are unit normals of the faces around it, or zeros; `limits` are cosines
    (see INSIDE).
    """
    known = (norm(given) > 0) & computed.any(axis=1)
    none, whole = limits
    cosine = dot(unit(given), computed)
    shares: Float[np.ndarray, " C"] = np.clip((none - cosine) / (none - whole), 0.0, 1.0)
    return np.where(known, shares, 0.0)


def _own_shares_at_border(
    given: Float[np.ndarray, "C 3"],
    computed: Float[np.ndarray, "C 3"],
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    corners: Int[np.ndarray, "F 3"],
    at_border: Bool[np.ndarray, " C"],
) -> Float[np.ndarray, " B"]:
    """Return the shares of normals at borders: 0 up to 1° from some average of faces, 1 from 2°.

    `corners` number the normals at the corners of `faces`.
    """
    near = at_border[corners].any(axis=1)
    a, b, c = np.moveaxis(points[faces[near]], 1, 0)
    by_area = cross(b - a, c - a)
    averages = [computed]
    for weighted in (by_area, unit(by_area)):
        sums = np.zeros_like(given)
        np.add.at(sums, corners[near], weighted[:, None])
        averages.append(unit(sums))
    shares = [own_shares(given[at_border], each[at_border], AT_BORDER) for each in averages]
    return np.min(shares, axis=0)


def border_vertices(topology: Topology) -> Bool[np.ndarray, " V"]:
    """Return the vertices of edges that do not lie between two faces."""
    kind = topology.edge_class
    rim = (kind != EdgeClass.INTERIOR) & (kind != EdgeClass.CREASE)
    return marked(topology.edges[rim].reshape(-1), topology.vertex_count)


@dataclass(frozen=True, eq=False)
class Shading:
    """Unit normals of the G groups of refined corners.

    Attributes:
        groups: the groups.
        rest: (G, 3) in the base pose.
        morphed: for each morph target at weight 1; None if it does not move both vertices and
            normals of any primitive.
    """

    groups: NormalGroups
    rest: Float[np.ndarray, "G 3"]
    morphed: tuple[Float[np.ndarray, "G 3"] | None, ...]

    def exact(self, group: Int[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
        """Return the normals at rest of vertices in given groups."""
        return np.take(self.rest, group, axis=0)

    def rounded(self, group: Int[np.ndarray, " N"]) -> Float32[np.ndarray, "N 3"]:
        """Return the normals at rest of vertices in given groups, in single precision."""
        return rounded_rows(self.rest, group, Blocks(available_threads()))

    def under_targets(
        self, group: Int[np.ndarray, " N"]
    ) -> tuple[Float[np.ndarray, "N 3"] | None, ...]:
        """Return the normals under each morph target of vertices in given groups."""
        return tuple(
            None if morphed is None else np.take(morphed, group, axis=0) for morphed in self.morphed
        )


def shade(
    control: ControlMesh,
    split: Split,
    points: Float[np.ndarray, "V 3"],
    skin_and_morph: SkinAndMorph,
    limit_normals: Float[np.ndarray, "V 3"] | None,
    stages: Stages,
) -> Shading | None:
    """Return the normals of a refined mesh with vertices at `points`; None without normals.

    `split` is that of its kept faces. `limit_normals`, if given, replace those of the faces, but
    for the author's own.
    """
    groups = normal_groups(control, split)
    if groups is None:
        return None
    poses = 1 + len(skin_and_morph.deltas)
    with stages.part(GROUPING, GROUPING + (1 - GROUPING) / poses):
        of_faces = exact = groups.normals(points, groups.before, stages)
        if limit_normals is not None:
            exact = groups.with_limit(of_faces, limit_normals)
        rest = groups.with_own(exact.copy(), None)
    morphed: list[Float[np.ndarray, "G 3"] | None] = []
    with stages.part(GROUPING + (1 - GROUPING) / poses, 1.0):
        for target, delta in enumerate(skin_and_morph.deltas):
            with stages.part(target / (poses - 1), (target + 1) / (poses - 1)):
                normals = None
                if _moves_normals(control, target):
                    posed = groups.normals(points + delta, lambda: of_faces, stages)
                    if limit_normals is not None:  # what does not move keeps its normal
                        posed = safe_unit(exact + (posed - of_faces))
                    normals = groups.with_own(posed, target).astype(np.float32)
                morphed.append(normals)
    return Shading(groups, rest, tuple(morphed))


def _moves_normals(control: ControlMesh, target: int) -> bool:
    return any(
        target < len(primitive.targets) and {"POSITION", "NORMAL"} <= set(primitive.targets[target])
        for primitive in control.primitives
    )
