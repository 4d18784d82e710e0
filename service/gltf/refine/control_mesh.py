"""The control mesh of a glTF mesh: its triangle primitives, welded and cleaned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Int, Shaped

from pns_common.mesh import Cleaned, Mesh, clean, repeated_vertex

from ...meshes.weld import Weld, weld
from ...meshes.weld_tolerance import WHOLE, weld_within
from ..read.primitives import TrianglePrimitive
from .joined_normals import NO_NORMAL, joined_normals
from .parts import Parts
from .skin_and_morph import SkinAndMorph, read_skin_and_morph


@dataclass(frozen=True, eq=False)
class ControlMesh:
    """All triangle primitives of a mesh, joined by position and by what moves it.

    Attributes:
        primitives: in file order.
        weld: the joined mesh over all their faces.
        rows: which rows of `weld.vertex_of` are whose.
        kept: for each primitive, which of its faces do not name a welded vertex twice.
        cleaned: the mesh to refine; None where no face is left.
        skin_and_morph: what follows the rows of all primitives.
        near: for each part how many vertices were joined that are not equal.
        authored: whether its normals are its file's, and not made anew.
    """

    primitives: Sequence[TrianglePrimitive]
    weld: Weld
    rows: list[slice]
    kept: list[Bool[np.ndarray, " F"]]
    cleaned: Cleaned | None
    skin_and_morph: SkinAndMorph
    near: Int[np.ndarray, " P"]
    authored: bool = True

    @property
    def copies(self) -> int:
        """Faces with the same three vertices as an earlier one: refined once, kept each."""
        return 0 if self.cleaned is None else self.cleaned.dropped_duplicate

    @cached_property
    def normal_labels(self) -> Int[np.ndarray, " N"]:
        """What rows share that have one normal at one vertex; NO_NORMAL where there is none."""
        labels = np.full(len(self.weld.vertex_of), NO_NORMAL)
        chosen = [n for n, p in enumerate(self.primitives) if "NORMAL" in p.attributes]
        if chosen:
            rows = np.concatenate(
                [np.arange(self.rows[n].start, self.rows[n].stop) for n in chosen]
            )
            normals = np.concatenate([self.primitives[n].attributes["NORMAL"] for n in chosen])
            labels[rows] = joined_normals(self.weld.vertex_of[rows], normals)
        return labels

    def of_cleaned(
        self, cleaned: Cleaned, of_kept: Shaped[np.ndarray, "P ..."]
    ) -> Shaped[np.ndarray, "F ..."]:
        """Return for each face of the mesh to refine what belongs to the kept face that it is."""
        place = cleaned.face_map[np.concatenate(self.kept)]
        of_face = np.empty((len(cleaned.mesh.faces), *of_kept.shape[1:]), dtype=of_kept.dtype)
        of_face[place[place >= 0]] = of_kept[place >= 0]
        return of_face

    def with_new_normals(self, primitives: Sequence[TrianglePrimitive]) -> ControlMesh:
        """Return the same mesh over primitives with new normals: more rows in the same places."""
        rows = _rows_of(primitives)
        vertex_of = np.full(rows[-1].stop, -1, dtype=np.int64)
        vertex_of[np.concatenate(_corners_of(primitives, rows))] = self.weld.faces
        return replace(
            self,
            primitives=primitives,
            weld=replace(self.weld, vertex_of=vertex_of),
            rows=rows,
            skin_and_morph=read_skin_and_morph(primitives),
            authored=False,
        )


def control_mesh(
    primitives: Sequence[TrianglePrimitive],
    tolerance: float,
    unit: float | None,
    parts: Parts | None = None,
) -> ControlMesh:
    """Weld and clean the triangle primitives of one mesh; `tolerance` and `unit` as weld_within.

    `parts` of a union are never joined, and come in their order in the mesh to refine; None: it is
    one mesh.
    """
    rows = _rows_of(primitives)
    positions = np.concatenate([primitive.attributes["POSITION"] for primitive in primitives])
    corners = _corners_of(primitives, rows)
    skin_and_morph = read_skin_and_morph(primitives)
    movement, faces = skin_and_morph.labels, np.concatenate(corners)
    order, starts = None, WHOLE
    if parts is not None:
        movement, order = parts.apart(movement), parts.order
        faces, starts = faces[order], np.searchsorted(parts.of_face[order], np.arange(parts.count))
    exact = weld(positions, faces, movement)
    welded = weld_within(exact, tolerance, unit, movement, starts)
    proper = ~repeated_vertex(welded.faces)
    cleaned = clean(Mesh(welded.points, welded.faces)) if proper.any() else None
    near = _vertex_counts(exact.faces, starts) - _vertex_counts(welded.faces, starts)
    if order is not None:
        # Back from the order of the parts to that of the primitives.
        place = np.argsort(order)
        proper, welded = proper[place], replace(welded, faces=welded.faces[place])
        if cleaned is not None:
            cleaned = replace(
                cleaned,
                face_map=cleaned.face_map[place],
                representative=cleaned.representative[place],
            )
    return ControlMesh(
        primitives=primitives,
        weld=welded,
        rows=rows,
        kept=[proper[part] for part in slices([len(own) for own in corners])],
        cleaned=cleaned,
        skin_and_morph=skin_and_morph,
        near=near,
    )


def _rows_of(primitives: Sequence[TrianglePrimitive]) -> list[slice]:
    return slices([len(primitive.attributes["POSITION"]) for primitive in primitives])


def _corners_of(
    primitives: Sequence[TrianglePrimitive], rows: Sequence[slice]
) -> list[Int[np.ndarray, "F 3"]]:
    return [p.corners + part.start for p, part in zip(primitives, rows, strict=True)]


def _vertex_counts(
    faces: Int[np.ndarray, "F 3"], starts: Int[np.ndarray, " P"]
) -> Int[np.ndarray, " P"]:
    """Count the vertices of each part, numbered part by part as they first appear."""
    if not len(faces):
        return np.zeros(len(starts), dtype=np.int64)
    a, b, c = faces.T
    return np.diff(np.maximum.reduceat(np.maximum(np.maximum(a, b), c), starts), prepend=-1)


def vertex_rows(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, " V"]:
    """Return for each vertex of the mesh to refine the first of the rows that are it."""
    used = np.flatnonzero(control.weld.vertex_of >= 0)[::-1]
    row = np.empty(len(control.weld.points), dtype=np.int64)
    row[control.weld.vertex_of[used]] = used
    return row[cleaned.vertex_map >= 0]


def slices(lengths: Sequence[int]) -> list[slice]:
    """Return consecutive slices of the given lengths."""
    ends = np.cumsum([0, *lengths]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]
