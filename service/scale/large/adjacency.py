"""The faces at each vertex of a mesh, ascending: sorted outside memory, a range of vertices a time.

The corners are first dealt out into files by ranges of vertices; each range is then sorted in
memory. So the largest thing in memory is a range, whatever the size of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Int

from pns_common.connectivity.topology import stable_sort

from ...errors import UnrefinableError
from .arrays import ArrayMesh, append, blocks_of, finished_array, let_go

# Vertices a range: about 12 million corners.
RANGE = 1 << 21
# Creases that are looked for at a time, among the faces at an end of each.
CREASES_AT_ONCE = 1 << 16
STARTS, FACES_AT = "starts.npy", "faces-at.npy"


@dataclass(frozen=True, eq=False)
class Adjacency:
    """Faces at vertex v: ``faces[starts[v]:starts[v + 1]]``, one for each corner."""

    starts: Int[np.ndarray, " N"]
    faces: Int[np.ndarray, " C"]

    @classmethod
    def open(cls, folder: Path) -> Adjacency:
        """Open what ``build`` left in a folder."""
        return cls(*(np.load(folder / name, mmap_mode="r") for name in (STARTS, FACES_AT)))

    def faces_at(self, vertices: Int[np.ndarray, " N"]) -> Int[np.ndarray, " M"]:
        """Return the faces at some vertices, ascending, each once."""
        return np.unique(self.faces[self.places_at(vertices)[0]])

    def places_at(
        self, vertices: Int[np.ndarray, " N"]
    ) -> tuple[Int[np.ndarray, " M"], Int[np.ndarray, " N"]]:
        """Return where in ``faces`` some vertices' lie, one vertex after another; how many."""
        begin, count = self.starts[vertices], self.valence(vertices)
        return np.arange(count.sum()) + np.repeat(begin - (np.cumsum(count) - count), count), count

    def valence(self, vertices: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
        """Return how many corners each has."""
        return self.starts[vertices + 1] - self.starts[vertices]


def build(mesh: ArrayMesh, folder: Path) -> None:
    """Write the adjacency into ``folder``."""
    vertices = len(mesh.positions)
    ranges = -(-vertices // RANGE)
    files = [folder / f"corners-{number}.tmp" for number in range(ranges)]
    for file in files:
        file.unlink(missing_ok=True)
    _deal_out(mesh, files)
    # What is complete is told by the last to get its name, FACES_AT.
    with (
        finished_array(folder / FACES_AT, (3 * len(mesh.faces),), "<i8") as faces,
        finished_array(folder / STARTS, (vertices + 1,), "<i8") as starts,
    ):
        done = 0
        for number, file in enumerate(files):
            first = number * RANGE
            count = min(RANGE, vertices - first)
            pairs = np.fromfile(file, dtype="<i8").reshape(-1, 2) if file.exists() else _NO_PAIRS
            key, order = stable_sort(pairs[:, 0] - first)
            faces[done : done + len(pairs)] = pairs[order, 1]
            valence = np.bincount(key, minlength=count)
            starts[first : first + count] = done + np.cumsum(valence) - valence
            done += len(pairs)
            let_go(faces, starts)
            file.unlink(missing_ok=True)
        starts[vertices] = done


_NO_PAIRS = np.zeros((0, 2), dtype=np.int64)


def check_creases(mesh: ArrayMesh, adjacency: Adjacency) -> None:
    """Check that each crease is an edge, as ``refine`` does: a part alone cannot tell.

    Raises:
        UnrefinableError: one is not.
    """
    if mesh.creases is None:
        return
    for rows in blocks_of(len(mesh.creases), CREASES_AT_ONCE):
        creases = np.asarray(mesh.creases[rows], dtype=np.int64)
        is_edge = ((creases >= 0) & (creases < len(mesh.positions))).all(axis=1)
        is_edge &= creases[:, 0] != creases[:, 1]
        asked = np.flatnonzero(is_edge)
        pairs = creases[asked]
        # The end with fewer faces is asked for the other one.
        swapped = adjacency.valence(pairs[:, 0]) > adjacency.valence(pairs[:, 1])
        pairs[swapped] = pairs[swapped][:, ::-1]
        places, count = adjacency.places_at(pairs[:, 0])
        crease = np.repeat(np.arange(len(pairs)), count)
        meets = (mesh.faces[adjacency.faces[places]] == pairs[crease, 1:]).any(axis=1)
        is_edge[asked] = np.bincount(crease[meets], minlength=len(pairs)) > 0
        if not is_edge.all():
            worst = int(np.argmin(is_edge))
            raise UnrefinableError(
                f"crease {rows.start + worst}: {creases[worst].tolist()} is no edge of the mesh"
            )
        let_go(mesh.creases, mesh.faces, adjacency.starts, adjacency.faces)


def _deal_out(mesh: ArrayMesh, files: list[Path]) -> None:
    """Append the (vertex, face) of each corner to the file of the vertex's range."""
    for rows in blocks_of(len(mesh.faces)):
        corners = mesh.faces[rows].reshape(-1).astype(np.int64)
        faces = np.repeat(np.arange(rows.start, rows.stop, dtype=np.int64), 3)
        ranges = corners // RANGE
        order = np.argsort(ranges, kind="stable")
        counts = np.bincount(ranges, minlength=len(files))
        ends = np.cumsum(counts)
        pairs = np.stack([corners, faces], axis=1)[order]
        for number in np.flatnonzero(counts):
            append(files[number], pairs[ends[number] - counts[number] : ends[number]])
        let_go(mesh.faces)


def ring_of(
    mesh: ArrayMesh, adjacency: Adjacency, faces: Int[np.ndarray, " N"], rings: int
) -> Int[np.ndarray, " M"]:
    """Return some faces (ascending) with so many rings of faces around them, ascending."""
    for _ in range(rings):
        vertices = np.unique(mesh.faces[faces])
        grown = adjacency.faces_at(vertices)
        if len(grown) == len(faces):
            return faces
        faces = grown
    return faces


def whole_vertices(
    adjacency: Adjacency, vertices: Int[np.ndarray, " V"], local_faces: Int[np.ndarray, "F 3"]
) -> Bool[np.ndarray, " V"]:
    """Return the vertices all of whose corners are among the faces of a part."""
    here = np.bincount(local_faces.reshape(-1), minlength=len(vertices))
    return here == adjacency.valence(vertices)
