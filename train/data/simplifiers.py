"""Six kinds of simplifiers: coarse meshes in practice come from any of them.

meshoptimizer has no wheel on PyPI: MeshLab's quadric that keeps vertices where they are stands for
its kind.
"""

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import fast_simplification
import numpy as np
import pyacvd
import pymeshlab
import pyvista
from numpy.typing import ArrayLike
from pyvista.core.errors import PyVistaDeprecationWarning

from pns_common import Mesh, clean

# How fast fast-simplification raises its threshold: below its own 7, for better triangles.
AGGRESSIVENESS = 5.0

# Vertices of the dense mesh over those of its clusters, at least.
CLUSTERED = 8

# Target length over that of as many equilateral triangles, at first.
EVEN = 1.15

# Of isotropic remeshing, done twice: the second length is corrected by the first result's faces.
ITERATIONS = 5

# Libraries without types.
meshlab: Any = pymeshlab
vtk: Any = pyvista

Simplifier = Callable[[Mesh, int], Mesh]


def fast_quadric(mesh: Mesh, faces: int, aggressiveness: float = AGGRESSIVENESS) -> Mesh:
    """Collapse edges by quadrics in sweeps with a rising threshold (fast-simplification)."""
    vertices, triangles = fast_simplification.simplify(
        mesh.vertices.copy(), mesh.faces.copy(), target_count=faces, agg=aggressiveness
    )[:2]
    return _mesh(vertices, triangles)


def meshlab_quadric(mesh: Mesh, faces: int) -> Mesh:
    """Collapse edges by quadrics, the cheapest first (Garland and Heckbert 1997; MeshLab)."""
    return _by_meshlab(mesh, _decimated, faces, planarquadric=True)


def meshlab_vertices(mesh: Mesh, faces: int) -> Mesh:
    """Collapse edges by quadrics onto vertices that are there already (MeshLab)."""
    return _by_meshlab(mesh, _decimated, faces, optimalplacement=False)


def vtk_quadric(mesh: Mesh, faces: int) -> Mesh:
    """Collapse edges by quadrics with VTK's own placement (vtkQuadricDecimation)."""
    done = vtk.make_tri_mesh(mesh.vertices, mesh.faces).decimate(1 - faces / len(mesh.faces))
    return _mesh(done.points, done.regular_faces)


def centroidal(mesh: Mesh, faces: int) -> Mesh:
    """Cluster vertices by area into Voronoi cells and join their middles (pyacvd)."""
    count, splits = faces // 2 + 2, 0
    while len(mesh.vertices) * 4**splits < CLUSTERED * count:
        splits += 1
    with warnings.catch_warnings():
        # pyacvd reads PyVista's arrays by their old names.
        warnings.simplefilter("ignore", PyVistaDeprecationWarning)
        clusters = pyacvd.Clustering(vtk.make_tri_mesh(mesh.vertices, mesh.faces))
        if splits:
            clusters.subdivide(splits)
        clusters.cluster(count)
        done: Any = clusters.create_mesh()
    return _mesh(done.points, done.regular_faces)


def isotropic(mesh: Mesh, faces: int) -> Mesh:
    """Remesh to one edge length (Botsch and Kobbelt 2004; MeshLab)."""
    corners = mesh.vertices[mesh.faces]
    twice = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(twice, axis=1).sum()) / 2
    length = EVEN * np.sqrt(4 / np.sqrt(3) * area / faces)

    first = _by_meshlab(mesh, _remeshed, length)
    return _by_meshlab(mesh, _remeshed, length * np.sqrt(len(first.faces) / faces))


SIMPLIFIERS: Mapping[str, Simplifier] = {
    "fast-quadric": fast_quadric,
    "MeshLab": meshlab_quadric,
    "MeshLab, own vertices": meshlab_vertices,
    "VTK": vtk_quadric,
    "pyacvd": centroidal,
    "isotropic": isotropic,
}


def _decimated(meshes: Any, faces: float, **options: bool) -> None:
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=int(faces), preservenormal=True, preserveboundary=True, **options
    )


def _remeshed(meshes: Any, length: float) -> None:
    meshes.meshing_isotropic_explicit_remeshing(
        targetlen=meshlab.PureValue(length), iterations=ITERATIONS, checksurfdist=False
    )


def _by_meshlab(mesh: Mesh, run: Callable[..., None], size: float, **options: bool) -> Mesh:
    meshes = meshlab.MeshSet(verbose=False)
    meshes.add_mesh(meshlab.Mesh(mesh.vertices, mesh.faces.astype(np.int32)))
    run(meshes, size, **options)
    done = meshes.current_mesh()
    return _mesh(done.vertex_matrix(), done.face_matrix())


def _mesh(vertices: ArrayLike, faces: ArrayLike) -> Mesh:
    return clean(Mesh(np.asarray(vertices, dtype=np.float64), np.asarray(faces))).mesh
