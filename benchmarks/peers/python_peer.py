"""`python python_peer.py NAME MESH LEVELS`, in the peers' environment: a Python library's Loop."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from protocol import read_mesh, serve

TRIANGLE = 3
Arrays = tuple[np.ndarray, np.ndarray]


def libigl(points: np.ndarray, faces: np.ndarray, levels: int) -> Callable[[], Arrays]:
    """Refine by igl.loop."""
    import igl

    wide = faces.astype(np.int64)
    return lambda: igl.loop(points, wide, levels)


def trimesh(points: np.ndarray, faces: np.ndarray, levels: int) -> Callable[[], Arrays]:
    """Refine by trimesh.remesh.subdivide_loop."""
    from trimesh.remesh import subdivide_loop

    wide = faces.astype(np.int64)
    return lambda: subdivide_loop(points, wide, iterations=levels)


def pyvista(points: np.ndarray, faces: np.ndarray, levels: int) -> Callable[[], Arrays]:
    """Refine by PolyData.subdivide(subfilter="loop"), which is VTK's."""
    import pyvista

    def refine() -> Arrays:
        mesh = pyvista.PolyData.from_regular_faces(points, faces)
        refined = mesh.subdivide(levels, subfilter="loop")
        return refined.points, refined.regular_faces

    return refine


def open3d(points: np.ndarray, faces: np.ndarray, levels: int) -> Callable[[], Arrays]:
    """Refine by TriangleMesh.subdivide_loop."""
    import open3d

    def refine() -> Arrays:
        mesh = open3d.geometry.TriangleMesh(
            open3d.utility.Vector3dVector(points), open3d.utility.Vector3iVector(faces)
        )
        refined = mesh.subdivide_loop(levels)
        return np.asarray(refined.vertices), np.asarray(refined.triangles)

    return refine


PEERS = {peer.__name__: peer for peer in (libigl, trimesh, pyvista, open3d)}

if __name__ == "__main__":
    name, path, depth = sys.argv[1:]
    mesh = read_mesh(path)
    if mesh[1].shape[1] != TRIANGLE:
        sys.exit("Loop refines triangles")
    serve(PEERS[name](*mesh, int(depth)))
