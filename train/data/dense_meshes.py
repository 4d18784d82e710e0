"""Meshes that files hold: welded, cleaned, and the largest part of each."""

from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pns_common import Mesh, MeshError, clean
from train.connectivity import connect


def welded(mesh: Mesh) -> Mesh:
    """Return a mesh whose vertices at exactly one position are one, without degenerate faces.

    Raises:
        MeshError: nothing is left.
    """
    # −0 and 0 are one coordinate, but not the same bytes.
    positions, number = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)
    return clean(Mesh(positions, number.reshape(-1)[mesh.faces])).mesh


def largest_part(mesh: Mesh) -> Mesh:
    """Return the part of a mesh with the most faces; parts meet at no interior edge."""
    level = connect(mesh.faces, len(mesh.vertices))
    first, second = level.half_edges[level.interior].T.numpy() // 3
    count = len(mesh.faces)
    joins = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    _, part = connected_components(joins, directed=False)
    return clean(Mesh(mesh.vertices, mesh.faces[part == np.bincount(part).argmax()])).mesh


def is_manifold(mesh: Mesh) -> bool:
    """Return whether all edges are interior or boundary, and all vertices used, with one fan."""
    level = connect(mesh.faces, len(mesh.vertices))
    regular = bool((level.paired | level.boundary).all())
    used = len(np.unique(mesh.faces)) == len(mesh.vertices)
    return regular and used and bool((level.fans <= 1).all())


def read_mesh(path: Path) -> Mesh:
    """Return all triangles of a file, in its scene's coordinates, welded.

    Raises:
        MeshError: it cannot be read, or has no triangles.
    """
    read = _arrays_of_numpy if path.suffix.lower() == ".npz" else _arrays_of_scene
    try:
        vertices, faces = read(path)
    except Exception as error:  # on a broken file these readers fail as it comes
        raise MeshError("it cannot be read", element="file") from error
    return welded(Mesh(vertices, faces))


def _arrays_of_scene(path: Path) -> tuple[np.ndarray, np.ndarray]:
    # Coordinates that are no numbers are refused by the mesh.
    with np.errstate(invalid="ignore"):
        scene = trimesh.load_scene(path, process=False, skip_materials=True).to_mesh()
    return scene.vertices, scene.faces


def _arrays_of_numpy(path: Path) -> tuple[np.ndarray, np.ndarray]:
    # Opened here: of a broken archive numpy leaves the file open.
    with path.open("rb") as file, np.load(file) as arrays:
        return arrays["vertices"], arrays["faces"]
