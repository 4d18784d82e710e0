"""The control mesh of a glTF mesh: its triangle primitives, welded and cleaned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from pns_common.mesh import Cleaned, Mesh, clean, repeated_vertex
from service.gltf.primitives import TrianglePrimitive
from service.weld import Weld, weld


@dataclass(frozen=True, eq=False)
class ControlMesh:
    """All triangle primitives of a mesh, joined by position.

    Attributes:
        primitives: in file order.
        weld: the joined mesh over all their faces.
        rows: which rows of `weld.vertex_of` are whose.
        kept: for each primitive, which of its faces do not name a welded vertex twice.
        cleaned: the mesh to refine; None where no face is left.
    """

    primitives: Sequence[TrianglePrimitive]
    weld: Weld
    rows: list[slice]
    kept: list[Bool[np.ndarray, " F"]]
    cleaned: Cleaned | None

    @property
    def degenerate(self) -> int:
        """Faces that name a welded vertex twice: they have no area and are dropped."""
        return sum(int((~keep).sum()) for keep in self.kept)

    @property
    def copies(self) -> int:
        """Faces with the same three vertices as an earlier one: refined once, kept each."""
        return 0 if self.cleaned is None else self.cleaned.dropped_duplicate


def control_mesh(primitives: Sequence[TrianglePrimitive]) -> ControlMesh:
    """Weld and clean the triangle primitives of one mesh."""
    rows = slices([len(primitive.attributes["POSITION"]) for primitive in primitives])
    positions = np.concatenate([primitive.attributes["POSITION"] for primitive in primitives])
    corners = [p.corners + at.start for p, at in zip(primitives, rows, strict=True)]
    welded = weld(positions, np.concatenate(corners))
    proper = ~repeated_vertex(welded.faces)
    return ControlMesh(
        primitives=primitives,
        weld=welded,
        rows=rows,
        kept=[proper[at] for at in slices([len(faces) for faces in corners])],
        cleaned=clean(Mesh(welded.points, welded.faces)) if proper.any() else None,
    )


def slices(lengths: Sequence[int]) -> list[slice]:
    """Consecutive slices of the given lengths."""
    ends = np.cumsum([0, *lengths]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]
