"""The control mesh of a glTF mesh: its triangle primitives, welded and cleaned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Int

from pns_common.mesh import Cleaned, Mesh, clean, repeated_vertex
from service.gltf.followers import Followers, read_followers
from service.gltf.primitives import TrianglePrimitive
from service.nearness import weld_within
from service.weld import Weld, weld


@dataclass(frozen=True, eq=False)
class ControlMesh:
    """All triangle primitives of a mesh, joined by position and by what moves it.

    Attributes:
        primitives: in file order.
        weld: the joined mesh over all their faces.
        rows: which rows of `weld.vertex_of` are whose.
        kept: for each primitive, which of its faces do not name a welded vertex twice.
        cleaned: the mesh to refine; None where no face is left.
        followers: what follows the rows of all primitives.
        near: how many vertices were joined that are not equal.
    """

    primitives: Sequence[TrianglePrimitive]
    weld: Weld
    rows: list[slice]
    kept: list[Bool[np.ndarray, " F"]]
    cleaned: Cleaned | None
    followers: Followers
    near: int

    @property
    def degenerate(self) -> int:
        """Faces that name a welded vertex twice: they have no area and are dropped."""
        return sum(int((~keep).sum()) for keep in self.kept)

    @property
    def copies(self) -> int:
        """Faces with the same three vertices as an earlier one: refined once, kept each."""
        return 0 if self.cleaned is None else self.cleaned.dropped_duplicate


def control_mesh(
    primitives: Sequence[TrianglePrimitive], tolerance: float, unit: float | None
) -> ControlMesh:
    """Weld and clean the triangle primitives of one mesh; `tolerance` and `unit` as weld_within."""
    rows = slices([len(primitive.attributes["POSITION"]) for primitive in primitives])
    positions = np.concatenate([primitive.attributes["POSITION"] for primitive in primitives])
    corners = [p.corners + at.start for p, at in zip(primitives, rows, strict=True)]
    followers = read_followers(primitives)
    movement = followers.labels
    exact = weld(positions, np.concatenate(corners), movement)
    welded = weld_within(exact, tolerance, unit, movement)
    proper = ~repeated_vertex(welded.faces)
    return ControlMesh(
        primitives=primitives,
        weld=welded,
        rows=rows,
        kept=[proper[at] for at in slices([len(faces) for faces in corners])],
        cleaned=clean(Mesh(welded.points, welded.faces)) if proper.any() else None,
        followers=followers,
        near=len(exact.points) - len(welded.points),
    )


def vertex_rows(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, " V"]:
    """For each vertex of the mesh to refine the first of the primitives' rows that are it."""
    used = np.flatnonzero(control.weld.vertex_of >= 0)[::-1]
    row = np.empty(len(control.weld.points), dtype=np.int64)
    row[control.weld.vertex_of[used]] = used
    return row[cleaned.vertex_map >= 0]


def slices(lengths: Sequence[int]) -> list[slice]:
    """Consecutive slices of the given lengths."""
    ends = np.cumsum([0, *lengths]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]
