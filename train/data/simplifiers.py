"""Several ways to simplify a dense mesh: coarse meshes in practice come from any of them."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import fast_simplification
import igl
import numpy as np
from jaxtyping import Int
from numpy.typing import ArrayLike

from pns_common import Mesh, MeshError, clean
from train.data.dense_meshes import largest_part

# How fast fast-simplification raises its threshold: below its own 7, for better triangles.
AGGRESSIVENESS = 5.0

# Share of the simplification that its largest part has to hold.
LEAST_KEPT = 0.8

# Cells of the grid along the longest side of what is clustered, at most.
MOST_CELLS = 512

# A result is used where its faces are within this factor of the target.
CLOSENESS = 1.6

Simplifier = Callable[[Mesh, int], Mesh]


def fast_quadric(mesh: Mesh, faces: int, aggressiveness: float = AGGRESSIVENESS) -> Mesh:
    """Collapse edges by quadrics in sweeps with a rising threshold (fast-simplification)."""
    vertices, triangles = fast_simplification.simplify(
        mesh.vertices.copy(), mesh.faces.copy(), target_count=faces, agg=aggressiveness
    )[:2]
    return _mesh(vertices, triangles)


def quadric(mesh: Mesh, faces: int) -> Mesh:
    """Collapse edges by quadrics, the cheapest first (Garland and Heckbert 1997; libigl)."""
    vertices, triangles, *_ = igl.qslim(mesh.vertices, mesh.faces, faces)
    return _mesh(vertices, triangles)


def shortest_edges(mesh: Mesh, faces: int) -> Mesh:
    """Collapse the shortest edge to its midpoint: even triangles, whatever the shape (libigl)."""
    vertices, triangles, *_ = igl.decimate(mesh.vertices, mesh.faces, faces)
    return _mesh(vertices, triangles)


def clustered(mesh: Mesh, faces: int) -> Mesh:
    """Merge the vertices in one cell of a grid at their mean (Rossignac and Borrel 1993).

    The grid's fineness is found by bisection.
    """
    corner, extent = mesh.vertices.min(axis=0), float(np.ptp(mesh.vertices, axis=0).max())
    low, high, best, least = 2, MOST_CELLS, None, np.inf
    while low <= high:
        cells = (low + high) // 2
        merged = _merged(mesh, np.floor((mesh.vertices - corner) / extent * cells).astype(np.int64))
        count = 0 if merged is None else len(merged.faces)
        if merged is not None and abs(count - faces) < least:
            best, least = merged, abs(count - faces)
        low, high = (cells + 1, high) if count < faces else (low, cells - 1)
    if best is None:
        raise MeshError("clustering leaves nothing", element="mesh")
    return best


SIMPLIFIERS: Mapping[str, Simplifier] = MappingProxyType(
    {
        "fast-quadric": fast_quadric,
        "quadric": quadric,
        "shortest-edges": shortest_edges,
        "clustered": clustered,
    }
)


def simplified(mesh: Mesh, simplifier: Simplifier, faces: int) -> Mesh | None:
    """Return the largest part of a simplification; None where it is no fair coarse mesh.

    That is where too much is pinched off, or the simplifier stopped far from the target.
    """
    try:
        whole = simplifier(mesh, faces)
        part = largest_part(whole)
    except MeshError:
        return None
    near = faces / CLOSENESS <= len(part.faces) <= faces * CLOSENESS
    kept = len(part.faces) >= LEAST_KEPT * len(whole.faces)
    return part if near and kept else None


def _merged(mesh: Mesh, cell: Int[np.ndarray, "V 3"]) -> Mesh | None:
    # Cells in the order of their coordinates, 0 … MOST_CELLS.
    _, number = np.unique(cell @ (MOST_CELLS + 1) ** np.arange(2, -1, -1), return_inverse=True)
    members = np.bincount(number)
    sums = [np.bincount(number, column) for column in mesh.vertices.T]
    faces = number[mesh.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    # Two sheets that fall together, whichever way they face, are left out both.
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    single = np.sort(first[count == 1])
    if len(single) == 0:
        return None
    return _mesh(np.stack(sums, axis=1) / members[:, None], faces[single])


def _mesh(vertices: ArrayLike, faces: ArrayLike) -> Mesh:
    return clean(Mesh(np.asarray(vertices, dtype=np.float64), np.asarray(faces))).mesh
