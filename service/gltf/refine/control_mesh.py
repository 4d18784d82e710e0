"""Control meshes: triangle primitives of one glTF mesh, or of many, welded and cleaned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from pns_common.mesh.mesh import Cleaned, Mesh, clean, repeated_vertex
from pns_common.mesh.rows import distinct_rows, dot, norm, unit

from ...meshes.weld import WHOLE, Weld, weld, weld_by_label, weld_within
from ...options import Options
from ..read.primitives import TrianglePrimitive
from .polygons import Found, KeptFaces, polygons_of, triangles_of
from .skin import SkinAndMorph, read_skin_and_morph

# Exporters compute the two sides of a UV seam apart and round differently, in real files by up to
# about 0.01°. Normals within 0.1° are one; hard edges have degrees.
SAME_NORMAL = np.radians(0.1)
# Label of a row without a normal.
NO_NORMAL = -1
# A direction in which different normals rarely have equal coordinates.
SCAN = np.array([1.0, np.sqrt(2), np.sqrt(3)])


@dataclass(frozen=True, eq=False)
class Parts:
    """The P meshes of a union, whose primitives are joined number by number.

    Attributes:
        of_row: (N,) part of each row.
        of_face: (F,) part of each face.
        count: P.
    """

    of_row: Int[np.ndarray, " N"]
    of_face: Int[np.ndarray, " F"]
    count: int

    @property
    def order(self) -> Int[np.ndarray, " F"]:
        """The faces part by part, in each part in the order of its primitives."""
        return np.argsort(self.of_face, kind="stable")

    def count_faces(self, chosen: Bool[np.ndarray, " F"]) -> Int[np.ndarray, " P"]:
        """Count the chosen faces of each part."""
        return np.bincount(self.of_face[chosen], minlength=self.count)

    def apart(self, labels: Int[np.ndarray, " N"] | None) -> Int[np.ndarray, " N"]:
        """Return labels that rows share if they share `labels` and their part."""
        if labels is None:
            return self.of_row
        return distinct_rows(np.column_stack([labels, self.of_row]))


@dataclass(frozen=True, eq=False)
class ControlMesh:
    """All triangle primitives of a mesh, welded by position, morph targets and skin.

    Attributes:
        primitives: in file order.
        weld: the welded mesh over all their faces.
        rows: slices of `weld.vertex_of`, one for each primitive.
        kept: for each primitive, which faces have three different welded vertices.
        cleaned_or_none: the mesh to refine; None if no face is left.
        skin_and_morph: of the rows of all primitives.
        near: (P,) for each part, the number of unequal vertices that were joined.
        authored: whether the normals are the file's.
        polygons: what its triangles are refined as; None: as triangles.
    """

    primitives: Sequence[TrianglePrimitive]
    weld: Weld
    rows: list[slice]
    kept: list[Bool[np.ndarray, " F"]]
    cleaned_or_none: Cleaned | None
    skin_and_morph: SkinAndMorph
    near: Int[np.ndarray, " P"]
    authored: bool = True
    polygons: KeptFaces | None = None

    @property
    def is_empty(self) -> bool:
        """True where no face is left."""
        return self.cleaned_or_none is None

    @property
    def cleaned(self) -> Cleaned:
        """The mesh to refine. Raises ValueError if no face is left."""
        if self.cleaned_or_none is None:
            raise ValueError("this mesh has no face left")
        return self.cleaned_or_none

    @property
    def mesh(self) -> Mesh:
        """The mesh to refine. Raises ValueError if no face is left."""
        return self.cleaned.mesh

    @property
    def surface(self) -> Mesh:
        """The mesh to refine, of polygons where its triangles are joined."""
        return self.mesh if self.polygons is None else self.polygons.surface

    @cached_property
    def faces(self) -> KeptFaces:
        """The kept triangles, or the polygons that they form."""
        return self.polygons or triangles_of(self.weld.faces, self.cleaned)

    @property
    def copies(self) -> int:
        """Number of faces with the vertices of an earlier face; they are refined once."""
        return 0 if self.is_empty else self.cleaned.dropped_duplicate

    @property
    def kept_counts(self) -> list[int]:
        """Number of kept faces of each primitive."""
        return [int(keep.sum()) for keep in self.kept]

    @property
    def shares(self) -> list[slice]:
        """The kept faces of each primitive."""
        first = self.faces.corners[self.faces.offsets[:-1]] // 3
        ends = np.searchsorted(first, np.cumsum([0, *self.kept_counts])).tolist()
        return [slice(start, end) for start, end in pairwise(ends)]

    def rows_at_corners(self, number: int) -> Int[np.ndarray, " H"]:
        """Return a primitive's row at each corner of its kept faces."""
        faces, share, triangles = self.faces, self.shares[number], self.kept_counts[:number]
        begin, end = faces.offsets[[share.start, share.stop]]
        kept = self.primitives[number].corners[self.kept[number]].reshape(-1)
        return kept[faces.corners[begin:end] - 3 * sum(triangles)]

    @cached_property
    def normal_labels(self) -> Int[np.ndarray, " N"]:
        """Labels that rows of one vertex share if they have one normal; NO_NORMAL without."""
        labels = np.full(len(self.weld.vertex_of), NO_NORMAL)
        chosen = [n for n, p in enumerate(self.primitives) if "NORMAL" in p.attributes]
        if chosen:
            rows = np.concatenate(
                [np.arange(self.rows[n].start, self.rows[n].stop) for n in chosen]
            )
            normals = np.concatenate([self.primitives[n].attributes["NORMAL"] for n in chosen])
            labels[rows] = joined_normals(self.weld.vertex_of[rows], normals)
        return labels

    def of_cleaned(self, of_kept: Shaped[np.ndarray, "P ..."]) -> Shaped[np.ndarray, "F ..."]:
        """Return for each face of the mesh to refine the value of its kept face."""
        place = self.cleaned.face_map[np.concatenate(self.kept)]
        of_face = np.empty((len(self.mesh.faces), *of_kept.shape[1:]), dtype=of_kept.dtype)
        of_face[place[place >= 0]] = of_kept[place >= 0]
        return of_face

    def vertex_rows(self) -> Int[np.ndarray, " V"]:
        """Return the first row of each vertex of the mesh to refine."""
        used = np.flatnonzero(self.weld.vertex_of >= 0)[::-1]
        row = np.empty(len(self.weld.points), dtype=np.int64)
        row[self.weld.vertex_of[used]] = used
        return row[self.cleaned.vertex_map >= 0]

    def joined(self, found: Sequence[Found]) -> ControlMesh:
        """Return a copy whose triangles are refined as the polygons found in its primitives."""
        if self.is_empty:
            return self
        kept = self.cleaned.vertex_map[self.weld.faces[np.concatenate(self.kept)]]
        return replace(self, polygons=polygons_of(self.mesh, kept, found, self.kept))

    def with_new_normals(self, primitives: Sequence[TrianglePrimitive]) -> ControlMesh:
        """Return a copy over primitives with new normals: more rows at the same positions."""
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
    primitives: Sequence[TrianglePrimitive], options: Options, parts: Parts | None = None
) -> ControlMesh:
    """Weld and clean the triangle primitives of a mesh, as the options ask for.

    The `parts` of a union are never joined, and follow each other in the mesh to refine.
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
    if options.weld == "position":
        exact = weld(positions, faces, movement)
        tolerance, unit_of_length = options.weld_tolerance, options.weld_unit
        welded = weld_within(exact, tolerance, unit_of_length, movement, starts)
    else:
        exact = welded = weld_by_label(positions, faces, _labels(primitives, options, movement))
    proper = ~repeated_vertex(welded.faces)
    cleaned = clean(Mesh(welded.points, welded.faces)) if proper.any() else None
    near = _vertex_counts(exact.faces, starts) - _vertex_counts(welded.faces, starts)
    if order is not None:
        # From the order of the parts back to that of the primitives.
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
        cleaned_or_none=cleaned,
        skin_and_morph=skin_and_morph,
        near=near,
    )


def _labels(
    primitives: Sequence[TrianglePrimitive],
    options: Options,
    movement: Int[np.ndarray, " N"] | None,
) -> Int[np.ndarray, " N"]:
    """Label the rows of primitives that are one vertex of the file, or none with another."""
    if options.weld == "off":
        return np.arange(sum(len(p.attributes["POSITION"]) for p in primitives))
    named = [np.stack([np.full(len(p.rows), p.positions), p.rows], axis=1) for p in primitives]
    columns = [np.concatenate(named)] + ([] if movement is None else [movement[:, None]])
    return distinct_rows(np.hstack(columns))


def joined_normals(
    vertex: Int[np.ndarray, " N"], normals: Float[np.ndarray, "N 3"]
) -> Int[np.ndarray, " N"]:
    """Return labels that rows share if they have one vertex and nearly one normal.

    Directions count, not lengths; rows without a direction share it. Neighbours along a line are
    compared, at the cost of one sort: equal normals always share a label, nearly equal ones all but
    always.
    """
    # Most vertices, inside of smooth surfaces, have one row.
    several = np.flatnonzero((np.bincount(vertex) > 1)[vertex])
    v, n = vertex[several], unit(normals[several].astype(np.float64))
    # The bits of a matrix product would depend on where a row stands.
    order = np.lexsort((*n.T, dot(n, SCAN[None]), v))
    v, n = v[order], n[order]
    opens = np.ones(len(order), dtype=bool)
    opens[1:] = (v[1:] != v[:-1]) | (norm(n[1:] - n[:-1]) > SAME_NORMAL)
    labels = vertex.copy()
    labels[several[order]] = vertex.max(initial=-1) + np.cumsum(opens)
    return labels


def slices(lengths: Sequence[int]) -> list[slice]:
    """Return consecutive slices of the given lengths."""
    ends = np.cumsum([0, *lengths]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]


def _rows_of(primitives: Sequence[TrianglePrimitive]) -> list[slice]:
    return slices([len(primitive.attributes["POSITION"]) for primitive in primitives])


def _corners_of(
    primitives: Sequence[TrianglePrimitive], rows: Sequence[slice]
) -> list[Int[np.ndarray, "F 3"]]:
    return [p.corners + part.start for p, part in zip(primitives, rows, strict=True)]


def _vertex_counts(
    faces: Int[np.ndarray, "F 3"], starts: Int[np.ndarray, " P"]
) -> Int[np.ndarray, " P"]:
    """Count the vertices of each part; they are numbered by first appearance."""
    if not len(faces):
        return np.zeros(len(starts), dtype=np.int64)
    a, b, c = faces.T
    return np.diff(np.maximum.reduceat(np.maximum(np.maximum(a, b), c), starts), prepend=-1)
