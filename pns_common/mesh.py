"""The control mesh: vertices and faces, validated once so that every kernel may trust them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import marked
from pns_common.base.extent import extent
from pns_common.errors import MeshError, ParameterError

# Fourth powers of lengths (squared cross products) must neither overflow nor vanish in float64.
LARGEST_COORDINATE = 1e75
SMALLEST_EXTENT = 1e-70


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: ``vertices`` (V, 3) float64 and ``faces`` (F, 3) int64, both read-only.

    Both are copies: of arrays of any real or whole type, in any order in memory, or of lists that
    make such arrays. Faces run anticlockwise, seen from outside.

    No mesh is refused for its topology: boundaries, irregular edges, several components, bow-ties
    and isolated vertices are all allowed. Coordinates reach from −1e75 to 1e75, and their extent is
    at least 1e-70 or exactly 0.

    Raises:
        MeshError: wrong shapes or types, no faces, a masked number, a NaN, infinite or huge
            coordinate, an extent too small to compute with, or an index out of range; the error
            names the element.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]

    def __post_init__(self) -> None:
        vertices, faces = _array(self.vertices, "vertices"), _array(self.faces, "faces")
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise MeshError(f"shape {vertices.shape}, expected (V, 3)", element="vertices")
        if vertices.dtype.kind not in "fiu":
            raise MeshError(f"type {vertices.dtype}, expected real numbers", element="vertices")
        # Before the cast: an index of 2⁶⁴ − 1 would become −1.
        check_faces(faces, len(vertices))
        if len(faces) == 0:
            raise MeshError("no faces to refine", element="faces")
        vertices, faces = _frozen(vertices, np.float64), _frozen(faces, np.int64)
        low, high = extent(vertices)
        # Written so that NaN fails it too.
        if not ((low >= -LARGEST_COORDINATE) & (high <= LARGEST_COORDINATE)).all():
            fits = (np.abs(vertices) <= LARGEST_COORDINATE).all(axis=1)
            worst = int(np.argmin(fits))
            coordinates = vertices[worst].tolist()
            raise MeshError(
                f"coordinates {coordinates}, expected finite numbers up to {LARGEST_COORDINATE:g}",
                element="vertex",
                index=worst,
            )
        widest = (high - low).max()
        if 0 < widest < SMALLEST_EXTENT:
            raise MeshError(
                f"extent {widest:g}, expected at least {SMALLEST_EXTENT:g}: scale the mesh up",
                element="vertices",
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    def __repr__(self) -> str:
        return f"Mesh(vertices={len(self.vertices)}, faces={len(self.faces)})"

    def __setstate__(self, state: dict[str, np.ndarray]) -> None:
        """Take what a copy or a pickle holds: its arrays may be written to, a mesh's may not."""
        for name, array in state.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def of_refined(cls, vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> Mesh:
        """Make a mesh of arrays that a refinement step made and checked: not copied, not read."""
        mesh = object.__new__(cls)
        for name, array in (("vertices", vertices), ("faces", faces)):
            array.flags.writeable = False
            object.__setattr__(mesh, name, array)
        return mesh


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A cleaned mesh and how it came about. −1 in a map means dropped."""

    mesh: Mesh
    vertex_map: Int[np.ndarray, " V"]
    face_map: Int[np.ndarray, " F"]
    # For each old face the new face with the same three vertices, or −1 if it was degenerate:
    # what a dropped duplicate should follow.
    representative: Int[np.ndarray, " F"]
    dropped_degenerate: int
    dropped_duplicate: int
    dropped_vertices: int


def clean(mesh: Mesh) -> Cleaned:
    """Drop degenerate faces (a repeated vertex), duplicates and unreferenced vertices.

    Faces are duplicates when they have the same three vertices in any order; the first stays.
    What stays keeps its order.

    Raises:
        ParameterError: it is no Mesh.
        MeshError: every face is degenerate.
    """
    check_is_mesh(mesh)
    degenerate = repeated_vertex(mesh.faces)
    if degenerate.all():
        raise MeshError("every face is degenerate", element="faces")
    proper = np.flatnonzero(~degenerate)
    leader = _first_alike(np.take(mesh.faces, proper, axis=0), len(mesh.vertices))
    is_leader = leader == np.arange(len(proper))
    number = np.cumsum(is_leader) - 1

    representative = np.full(len(mesh.faces), -1, dtype=np.int64)
    representative[proper] = number[leader]
    face_map = np.full(len(mesh.faces), -1, dtype=np.int64)
    face_map[proper[is_leader]] = number[is_leader]

    kept = np.take(mesh.faces, proper[is_leader], axis=0)
    used = marked(kept.reshape(-1), len(mesh.vertices))
    vertex_map = np.where(used, np.cumsum(used) - 1, -1)
    same = len(kept) == len(mesh.faces) and used.all()
    return Cleaned(
        mesh=mesh if same else Mesh(mesh.vertices[used], vertex_map[kept]),
        vertex_map=vertex_map,
        face_map=face_map,
        representative=representative,
        dropped_degenerate=int(degenerate.sum()),
        dropped_duplicate=int(len(proper) - is_leader.sum()),
        dropped_vertices=int(len(used) - used.sum()),
    )


def check_is_mesh(given: object) -> None:
    """Refuse what is no Mesh.

    Raises:
        ParameterError: it is something else.
    """
    if not isinstance(given, Mesh):
        other = "Mesh(vertices, faces); subdivide takes arrays and other libraries' meshes"
        raise ParameterError("mesh", type(given), expected=other)


def check_faces(faces: np.ndarray, vertex_count: int) -> None:
    """Refuse what are no faces of so many vertices; there may be none.

    Raises:
        MeshError: wrong shape or type, or an index out of range.
    """
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise MeshError(f"shape {faces.shape}, expected (F, 3)", element="faces")
    if len(faces) == 0:  # an empty list has no integers
        return
    if faces.dtype.kind not in "iu":
        raise MeshError(f"type {faces.dtype}, expected integers", element="faces")
    if not (faces.min() >= 0 and faces.max() < vertex_count):
        inside = ((faces >= 0) & (faces < vertex_count)).all(axis=1)
        worst = int(np.argmin(inside))
        raise MeshError(
            f"indices {faces[worst].tolist()}, expected 0 … {vertex_count - 1}",
            element="face",
            index=worst,
        )


def repeated_vertex(faces: Int[np.ndarray, "F 3"]) -> Bool[np.ndarray, " F"]:
    """Return whether a face names a vertex twice."""
    a, b, c = faces.T
    return (a == b) | (b == c) | (c == a)


def _first_alike(faces: Int[np.ndarray, "F 3"], vertex_count: int) -> Int[np.ndarray, " F"]:
    """Return for each face the first that has the same three vertices, in whatever order."""
    # A face's number is the sum of its vertices', which are far apart: faces that are alike have
    # one number, and hardly any others do. Most meshes have no two, and a sort of numbers tells.
    of_vertex: Int[np.ndarray, " V"] = np.arange(1, vertex_count + 1, dtype=np.uint64)
    of_vertex *= np.uint64(0x9E3779B97F4A7C15)
    of_vertex ^= of_vertex >> np.uint64(29)
    of_vertex *= np.uint64(0xBF58476D1CE4E5B9)
    number = np.sort(of_vertex[faces[:, 0]] + of_vertex[faces[:, 1]] + of_vertex[faces[:, 2]])
    if (number[1:] != number[:-1]).all():
        return np.arange(len(faces))
    corners = np.sort(faces, axis=1)
    _, first, group = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    return first[group.reshape(-1)]


def _array(values: object, element: str) -> np.ndarray:
    """Return what numpy makes of the input, refused where rows differ in length or have holes."""
    if np.ma.is_masked(values):
        # numpy would read what lies under the mask.
        raise MeshError("masked numbers, expected three in each row", element=element)
    try:
        return np.asarray(values)
    except ValueError as error:
        raise MeshError(
            "rows of different lengths, expected three numbers each", element=element
        ) from error


def _frozen(values: np.ndarray, dtype: np.typing.DTypeLike) -> np.ndarray:
    """Return a read-only C-contiguous copy that no caller can change behind the mesh's back."""
    copy = np.array(values, dtype=np.dtype(dtype), order="C")
    copy.flags.writeable = False
    return copy
