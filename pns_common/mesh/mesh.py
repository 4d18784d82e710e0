"""The control mesh: vertices and faces, validated once so that every loop may trust them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.errors import MeshError, ParameterError
from pns_common.mesh.rows import extent
from pns_common.mesh.topology import Topology, build_topology
from pns_common.parallel import Blocks
from pns_common.parameters import is_masked

# Fourth powers of lengths (squared cross products) must neither overflow nor vanish in float64.
LARGEST_COORDINATE = 1e75
SMALLEST_EXTENT = 1e-70
TRIANGLE = 3
# meshio's names of faces, by their corners; the others are polygons.
CELLS = {3: "triangle", 4: "quad"}
# What it writes there of polygons: nothing.
FILES_OF_TRIANGLES = (".stl", ".off")


class Mesh:
    """A polygon mesh: vertices, and faces of any degree, anticlockwise seen from outside.

    Both are kept as read-only copies: of arrays of any real or whole type, or of lists that make
    such arrays. No mesh is refused for its topology: boundaries, irregular edges, several
    components, bow-ties and isolated vertices are all allowed. Coordinates reach from −1e75 to
    1e75, and their extent is at least 1e-70 or exactly 0.

    Args:
        vertices: (V, 3) real numbers.
        faces: (F, 3) triangles, (F, n) polygons of n corners, a list of polygons of any degrees,
            or a pair of arrays (corners, offsets): all corners in a row, and where those of each
            face begin, with their number at the end; whole numbers.

    Attributes:
        vertices: (V, 3) float64.
        corners: (H,) int64, the vertices of the faces, face after face.

    Raises:
        MeshError: wrong shapes or types, no faces, a face of fewer than three corners, a masked
            number, a NaN, infinite or huge coordinate, an extent too small to compute with, or an
            index out of range; the error names the element.

    Example:
        >>> Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]]).face_count
        1
    """

    __slots__ = ("_faces", "_offsets", "corners", "vertices")
    vertices: Float[np.ndarray, "V 3"]
    corners: Integer[np.ndarray, " H"]
    _offsets: Integer[np.ndarray, " F1"] | None
    _faces: Integer[np.ndarray, "F N"] | None

    def __init__(self, vertices: Any, faces: Any) -> None:
        given = _array(vertices, "vertices")
        if given.ndim != 2 or given.shape[1] != TRIANGLE:
            raise MeshError(f"shape {given.shape}, expected (V, 3)", element="vertices")
        if given.dtype.kind not in "fiu":
            raise MeshError(f"type {given.dtype}, expected real numbers", element="vertices")
        corners, offsets, degree = _faces_of(faces, len(given))
        if len(corners) == 0:
            raise MeshError("no faces to refine", element="faces")
        points = np.array(given, dtype=np.float64, order="C")
        _check_coordinates(points)
        self._keep(points, corners, offsets, degree)

    def _keep(
        self,
        vertices: Float[np.ndarray, "V 3"],
        corners: Integer[np.ndarray, " H"],
        offsets: Integer[np.ndarray, " F1"] | None,
        degree: int | None,
    ) -> None:
        """Keep arrays; ``degree`` is that of all faces, which then need no offsets."""
        for array in (vertices, corners):
            array.flags.writeable = False
        faces = None if degree is None else corners.reshape(-1, degree)
        values = vertices, corners, offsets, faces
        for name, value in zip(("vertices", "corners", "_offsets", "_faces"), values, strict=True):
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Mesh is read-only: {name} cannot be set")

    def __reduce__(self) -> tuple[Any, ...]:
        degree = None if self._faces is None else self._faces.shape[1]
        return _kept, (self.vertices, self.corners, self._offsets, degree)

    def __repr__(self) -> str:
        return f"Mesh(vertices={len(self.vertices)}, faces={self.face_count})"

    def _repr_html_(self) -> str:
        counts = {"vertices": len(self.vertices), "faces": len(self.offsets) - 1}
        return as_html(self, counts)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Mesh:
        """Read the faces of a file, by its ending: OBJ, or what meshio reads, as PLY, STL and OFF.

        Raises:
            ImportError: meshio is wanted and not installed.
            MeshError: as ``Mesh``, or meshio cannot read the file.
        """
        path = Path(path)
        if path.suffix.lower() == ".obj":
            return cls(*_read_obj(path))
        meshio = _meshio()
        try:
            read = meshio.read(path)
        except (meshio.ReadError, ValueError) as error:
            advice = f"{path}: meshio cannot read it: {error}; `pns subdivide` may"
            raise MeshError(advice) from error
        wanted = {*CELLS.values(), "polygon"}
        blocks = [block.data for block in read.cells if block.type in wanted]
        faces = blocks[0] if len(blocks) == 1 else [face for block in blocks for face in block]
        return cls(read.points, faces)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file by meshio, by its ending.

        Raises:
            ImportError: meshio is not installed.
            MeshError: there are polygons, and meshio writes triangles alone: as STL and OFF.
        """
        if Path(path).suffix.lower() in FILES_OF_TRIANGLES and not self.triangles:
            reason = f"polygons, expected triangles in {path}; triangulated() cuts them"
            raise MeshError(reason, element="faces")
        alike = None if self._faces is None else [(self._faces.shape[1], self._faces)]
        runs = alike or groupby(self.polygons, len)
        cells = [(CELLS.get(count, "polygon"), np.array([*rows], np.int32)) for count, rows in runs]
        _meshio().write_points_cells(path, self.vertices, cells)

    def triangulated(self) -> Mesh:
        """Cut each face into triangles that meet in its first corner.

        That is right for convex faces; ``cut_concave`` makes them.
        """
        if self.triangles:
            return self
        return Mesh(self.vertices, self.corners[fans(self.offsets)[0]])

    @property
    def offsets(self) -> Integer[np.ndarray, " F1"]:
        """Start of each face's corners, and the end of the last ones: (F + 1,)."""
        if self._offsets is not None:
            return self._offsets
        return _regular(len(self.corners), self.faces.shape[1])

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return len(self.offsets) - 1 if self._faces is None else len(self._faces)

    @property
    def faces(self) -> Integer[np.ndarray, "F N"]:
        """Vertices of each face, (F, 3) for triangles.

        Raises:
            MeshError: the faces have different degrees; ``polygons`` lists them.
        """
        if self._faces is None:
            raise MeshError("faces of different degrees, expected all alike", element="faces")
        return self._faces

    @property
    def polygons(self) -> list[Integer[np.ndarray, " N"]]:
        """Vertices of each face."""
        return np.split(self.corners, self.offsets[1:-1])

    @property
    def triangles(self) -> bool:
        """True where all faces are triangles."""
        return self._faces is not None and self._faces.shape[1] == TRIANGLE

    def topology(self, blocks: Blocks | None = None) -> Topology:
        """Return the mesh's edges; ``blocks`` shares the work among threads."""
        faces = self.faces if self.triangles else (self.corners, self.offsets)
        return build_topology(faces, len(self.vertices), blocks)

    @classmethod
    def of_refined(
        cls,
        vertices: Float[np.ndarray, "V 3"],
        faces: Integer[np.ndarray, "F N"] | Integer[np.ndarray, " H"],
        offsets: Integer[np.ndarray, " F1"] | None = None,
    ) -> Mesh:
        """Make a mesh of arrays that a refinement made and checked: neither copied nor read.

        Faces are their corners where ``offsets`` say where those of each begin.
        """
        if offsets is None:
            return _kept(vertices, faces.reshape(-1), None, faces.shape[1])
        return _kept(vertices, faces, offsets, _common_degree(offsets))


def _read_obj(path: Path) -> tuple[list[list[float]], list[list[int]]]:
    """Return the vertices and faces of an OBJ in its order, without what its corners carry.

    Raises:
        MeshError: a face or vertex that is none, with its line.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            kind, *fields = line.partition("#")[0].split() or [""]
            try:
                if kind == "v":
                    x, y, z = map(float, fields[:3])
                    vertices.append([x, y, z])
                elif kind == "f":
                    corners = [int(field.partition("/")[0]) for field in fields]
                    # Negative ones count from the last vertex so far.
                    faces.append([c - 1 if c > 0 else len(vertices) + c for c in corners])
            except ValueError as error:
                raise MeshError(str(error), element="line", index=number) from error
    return vertices, faces


def _meshio() -> Any:
    try:
        return import_module("meshio")
    except ImportError as error:
        raise ImportError("files other than OBJ need meshio: pip install meshio") from error


def _kept(
    vertices: Float[np.ndarray, "V 3"],
    corners: Integer[np.ndarray, " H"],
    offsets: Integer[np.ndarray, " F1"] | None,
    degree: int | None,
) -> Mesh:
    """Make a mesh of arrays that are known to be right."""
    mesh = object.__new__(Mesh)
    mesh._keep(vertices, corners, offsets, degree)  # pyright: ignore[reportPrivateUsage]
    return mesh


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A cleaned mesh and how it came about. −1 in a map means dropped."""

    mesh: Mesh
    vertex_map: Integer[np.ndarray, " V"]
    face_map: Integer[np.ndarray, " F"]
    # For each old face the new face with the same vertices, or −1 if it was degenerate: what a
    # dropped duplicate should follow.
    representative: Integer[np.ndarray, " F"]
    dropped_degenerate: int
    dropped_duplicate: int
    dropped_vertices: int


def clean(mesh: Mesh) -> Cleaned:
    """Drop degenerate faces (a repeated vertex), duplicates and unreferenced vertices.

    Faces are duplicates when they run through the same vertices, either way round; the first stays.
    What stays keeps its order.

    Raises:
        ParameterError: it is no Mesh.
        MeshError: every face is degenerate.

    Example:
        >>> mesh = Mesh(np.eye(4, 3), [[0, 1, 2], [2, 1, 0], [0, 1, 1]])
        >>> clean(mesh).mesh.face_count
        1
    """
    check_is_mesh(mesh)
    degrees, leader = np.diff(mesh.offsets), np.arange(mesh.face_count)
    degenerate = np.empty(mesh.face_count, dtype=bool)
    for degree in np.flatnonzero(np.bincount(degrees)):
        rows = np.flatnonzero(degrees == degree)
        if mesh.triangles:
            faces = mesh.faces
        else:
            faces = mesh.corners[mesh.offsets[rows, None] + np.arange(degree)]
        degenerate[rows] = repeats = repeated_vertex(faces)
        proper = np.flatnonzero(~repeats)
        alike = _first_alike(np.take(faces, proper, axis=0), len(mesh.vertices))
        leader[rows[proper]] = rows[proper[alike]]
    if degenerate.all():
        raise MeshError("every face is degenerate", element="faces")
    stays = ~degenerate & (leader == np.arange(len(leader)))
    number = np.cumsum(stays) - 1
    kept = mesh.corners if stays.all() else mesh.corners[np.repeat(stays, degrees)]
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[kept] = True
    vertex_map = np.where(used, np.cumsum(used) - 1, -1)
    offsets = np.append(0, np.cumsum(degrees[stays]))
    same = stays.all() and used.all()
    return Cleaned(
        mesh=mesh if same else Mesh(mesh.vertices[used], (vertex_map[kept], offsets)),
        vertex_map=vertex_map,
        face_map=np.where(stays, number, -1),
        representative=np.where(degenerate, -1, number[leader]),
        dropped_degenerate=int(degenerate.sum()),
        dropped_duplicate=int(len(leader) - degenerate.sum() - stays.sum()),
        dropped_vertices=int(len(used) - used.sum()),
    )


def as_html(mesh: Mesh, counts: Mapping[str, object]) -> str:
    """Return a table, below a small picture where PyVista is installed: for notebooks."""
    rows = (f"<tr><th>{k}</th><td>{escape(str(v))}</td></tr>" for k, v in counts.items())
    try:
        picture: str = import_module("pns_common.pyvista").picture(mesh)
    except ImportError:
        picture = ""
    return f"{picture}<table>{''.join(rows)}</table>"


def fans(
    offsets: Integer[np.ndarray, " F1"],
) -> tuple[Integer[np.ndarray, "T 3"], Integer[np.ndarray, " T"]]:
    """Return the corners of the triangles that faces are cut into, and the face of each."""
    counts = np.diff(offsets) - 2
    if (counts == 1).all():
        return np.arange(3 * len(counts)).reshape(-1, 3), np.arange(len(counts))
    face = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(len(face)) - (np.cumsum(counts) - counts)[face] + 1
    first = offsets[face]
    return np.stack([first, first + step, first + step + 1], axis=1), face


def check_is_mesh(given: object) -> None:
    """Refuse what is no Mesh.

    Raises:
        ParameterError: it is something else.
    """
    if not isinstance(given, Mesh):
        other = "Mesh(vertices, faces); subdivide takes arrays and other libraries' meshes"
        raise ParameterError("mesh", type(given), expected=other)


def repeated_vertex(faces: Integer[np.ndarray, "F N"]) -> Bool[np.ndarray, " F"]:
    """Return whether a face names a vertex twice."""
    if faces.shape[1] == TRIANGLE:
        a, b, c = faces.T
        return (a == b) | (b == c) | (c == a)
    return (np.diff(np.sort(faces, axis=1), axis=1) == 0).any(axis=1)


def as_polygons(faces: Any, vertex_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return corners and offsets of faces as ``Mesh`` takes them; there may be none.

    Raises:
        MeshError: as ``Mesh``.
    """
    corners, offsets, degree = _faces_of(faces, vertex_count)
    return corners, _regular(len(corners), degree or TRIANGLE) if offsets is None else offsets


def _faces_of(faces: Any, vertex_count: int) -> tuple[np.ndarray, np.ndarray | None, int | None]:
    """Return corners, offsets, and the degree of all faces; no offsets of a table's rows."""
    several = isinstance(faces, list | tuple)
    degree: int | None = None
    given: list[Any] = list(faces) if several else []  # pyright: ignore[reportUnknownArgumentType]
    rows = [_array(face, "faces") for face in given]
    degrees = [face.size for face in rows]
    pair = [isinstance(face, np.ndarray) for face in given] == [True, True]
    if isinstance(faces, tuple) and pair and [face.ndim for face in rows] == [1, 1]:
        corners, offsets = rows
        _check_offsets(offsets, len(corners))
    elif len(set(degrees)) > 1:
        # An empty list has no integers to tell it from one of floats.
        corners = np.concatenate([face.reshape(-1) for face in rows if face.size])
        offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(degrees)])
    else:
        table = _array(given if several else faces, "faces")
        if table.size == 0:
            return np.zeros(0, dtype=np.int64), None, None
        if table.ndim != 2:
            raise MeshError(f"shape {table.shape}, expected (F, 3)", element="faces")
        corners, offsets = table.reshape(-1), None
        degree = table.shape[1]
    if len(corners) and corners.dtype.kind not in "iu":
        raise MeshError(f"type {corners.dtype}, expected integers", element="faces")
    counts = np.full(1, degree) if offsets is None else np.diff(offsets)
    few = np.flatnonzero(counts < TRIANGLE)
    if len(few):
        reason = f"{counts[few[0]]} corners, expected at least 3"
        raise MeshError(reason, element="face", index=int(few[0]))
    # Before the cast: an index of 2⁶⁴ − 1 would become −1.
    _check_indices(corners, offsets, degree, vertex_count)
    corners = np.array(corners, dtype=np.int64)
    if offsets is None:
        return corners, None, degree
    offsets = offsets.astype(np.int64)
    return corners, offsets, _common_degree(offsets)


def _regular(count: int, degree: int) -> Integer[np.ndarray, " F1"]:
    """Return the offsets of faces that have one degree and so many corners together."""
    return np.arange(0, count + 1, degree)


def _common_degree(offsets: Integer[np.ndarray, " F1"]) -> int | None:
    """Return the degree of all faces; None if they differ, or there is none."""
    degrees = np.diff(offsets)
    return int(degrees[0]) if len(degrees) and (degrees == degrees[0]).all() else None


def _check_offsets(offsets: np.ndarray, count: int) -> None:
    whole = offsets.dtype.kind in "iu" and len(offsets) > 0
    if not whole or offsets[0] != 0 or offsets[-1] != count or (offsets[1:] < offsets[:-1]).any():
        expected = f"whole numbers that rise from 0 to {count}, the number of corners"
        raise MeshError(f"offsets {offsets.tolist()[:4]} …, expected {expected}", element="faces")


def _check_indices(
    corners: np.ndarray, offsets: np.ndarray | None, degree: int | None, vertex_count: int
) -> None:
    if len(corners) == 0 or (corners.min() >= 0 and corners.max() < vertex_count):
        return
    outside = np.flatnonzero((corners < 0) | (corners >= vertex_count))
    first: int = outside[0]
    offsets = _regular(len(corners), degree or TRIANGLE) if offsets is None else offsets
    worst = int(np.searchsorted(offsets, first, side="right")) - 1
    face = corners[offsets[worst] : offsets[worst + 1]].tolist()
    raise MeshError(f"indices {face}, expected 0 … {vertex_count - 1}", element="face", index=worst)


def _check_coordinates(vertices: Float[np.ndarray, "V 3"]) -> None:
    low, high = extent(vertices)
    # Written so that NaN fails it too.
    if not ((low >= -LARGEST_COORDINATE) & (high <= LARGEST_COORDINATE)).all():
        fits = (np.abs(vertices) <= LARGEST_COORDINATE).all(axis=1)
        worst = int(np.argmin(fits))
        raise MeshError(
            f"coordinates {vertices[worst].tolist()}, expected finite numbers up to "
            f"{LARGEST_COORDINATE:g}",
            element="vertex",
            index=worst,
        )
    widest = (high - low).max()
    if 0 < widest < SMALLEST_EXTENT:
        raise MeshError(
            f"extent {widest:g}, expected at least {SMALLEST_EXTENT:g}: scale the mesh up",
            element="vertices",
        )


def _first_alike(faces: Integer[np.ndarray, "F N"], vertex_count: int) -> Integer[np.ndarray, " F"]:
    """Return for each face the first that runs through the same vertices, either way round."""
    # A face's number is the sum of its vertices', which are far apart: faces that are alike have
    # one number, and hardly any others do. Most meshes have no two, and a sort of numbers tells.
    of_vertex: Integer[np.ndarray, " V"] = np.arange(1, vertex_count + 1, dtype=np.uint64)
    of_vertex *= np.uint64(0x9E3779B97F4A7C15)
    of_vertex ^= of_vertex >> np.uint64(29)
    of_vertex *= np.uint64(0xBF58476D1CE4E5B9)
    number = np.zeros(len(faces), dtype=np.uint64)
    for column in faces.T:
        number += of_vertex[column]
    number.sort()
    if (number[1:] != number[:-1]).all():
        return np.arange(len(faces))
    # From the lowest vertex on, towards its lower neighbour.
    every, degree = np.arange(len(faces))[:, None], faces.shape[1]
    first: Integer[np.ndarray, " F"] = np.argmin(faces, axis=1)
    rows = faces[every, (first[:, None] + np.arange(degree)) % degree]
    back = rows[:, 1] > rows[:, -1]
    rows[back, 1:] = rows[back, :0:-1]
    _, leader, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return leader[group.reshape(-1)]


def _array(values: object, element: str) -> np.ndarray:
    """Return what numpy makes of the input, refused where rows differ in length or have holes."""
    if is_masked(values):
        raise MeshError("masked numbers, expected three in each row", element=element)
    try:
        return np.asarray(values)
    except ValueError as error:
        raise MeshError(
            "rows of different lengths, expected three numbers each", element=element
        ) from error
