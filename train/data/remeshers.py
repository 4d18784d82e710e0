"""Remeshing of dense shapes in quads, whose vertices are laid onto the shape."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import igl
import numpy as np
import pynanoinstantmeshes
from jaxtyping import Float

from pns_common import Mesh, MeshError

# A library without types.
instant_meshes: Any = pynanoinstantmeshes

# Its last step splits each face in four.
SPLIT, FEWEST = 4, 6


def instant(mesh: Mesh, faces: int, smoothed: int = 2) -> Mesh:
    """Remesh in quads along the shape's curvature, smoothed so often (Jakob et al. 2015).

    Raises:
        MeshError: no face is left, or it gives up.
    """
    try:
        with _silence():
            points, quads = instant_meshes.remesh(
                mesh.vertices.astype(np.float32),
                mesh.faces.astype(np.uint32),
                max(faces // SPLIT, FEWEST),
                smooth_iter=smoothed,
                deterministic=True,
            )
    except RuntimeError as error:
        raise MeshError(f"Instant Meshes gives up: {error}", element="faces") from error
    return laid_onto(mesh, _tidied(points.astype(np.float64), quads.tolist()))


def with_points(mesh: Mesh, points: Float[np.ndarray, "V 3"]) -> Mesh:
    """Return a mesh with its vertices elsewhere."""
    return Mesh(points, (mesh.corners, mesh.offsets))


def laid_onto(shape: Mesh, mesh: Mesh) -> Mesh:
    """Return a mesh with its vertices at the nearest points of a shape's triangles."""
    boxes, points, faces = igl.AABB(), shape.vertices.copy(), shape.faces.copy()
    boxes.init(points, faces)
    _, _, nearest = boxes.squared_distance(points, faces, mesh.vertices.copy())
    return with_points(mesh, np.asarray(nearest))


def _tidied(points: Float[np.ndarray, "V 3"], polygons: list[list[int]]) -> Mesh:
    """Return a mesh without repeated corners, faces and unused vertices."""
    faces: dict[frozenset[int], list[int]] = {}
    for polygon in polygons:
        face = [corner for place, corner in enumerate(polygon) if corner != polygon[place - 1]]
        if len(set(face)) == len(face) > 2:
            faces.setdefault(frozenset(face), face)
    if not faces:
        raise MeshError("no face is left", element="faces")
    used, numbers = np.unique(np.concatenate([*faces.values()]), return_inverse=True)
    return Mesh(points[used], (numbers, np.cumsum([0, *map(len, faces.values())])))


@contextmanager
def _silence() -> Iterator[None]:
    """Send what a library prints past Python nowhere."""
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
