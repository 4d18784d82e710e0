"""The crease lines of a mesh, by whoever finds them sooner."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.base.blocks import available_threads
from pns_common.base.parameters import is_number
from pns_common.connectivity.creases import Creases
from pns_common.connectivity.topology import build_topology
from pns_common.errors import ParameterError
from pns_common.fused import fits, kernel_blocks, kernels_available, kernels_loaded
from pns_common.geometry.crease_lines import CREASE_ANGLE, line_rows
from pns_common.geometry.frames import face_normals
from pns_common.mesh import Mesh, check_is_mesh


def crease_lines(mesh: Mesh, angle: float = CREASE_ANGLE) -> Int[np.ndarray, "N 2"]:
    """Return the edges that a mesh shows to be sharp, as pairs of vertices, for ``refine``.

    These turn by more than ``angle`` (degrees, between 0 and 180), lie between sides that are flat
    beside them, and go on at both ends (geometry/crease_lines.py).

    Raises:
        ParameterError: it is no Mesh, or the angle is out of range.
    """
    check_is_mesh(mesh)
    if not (is_number(angle) and 0 < angle < 180):
        raise ParameterError("angle", angle, expected="degrees between 0 and 180")
    points, faces = mesh.vertices, mesh.faces
    if kernels_available() and kernels_loaded() and fits(len(points), len(faces), 1):
        from pns_common.fused.crease_lines import crease_line_rows
        from pns_common.fused.face_measures import face_normals as measured_normals
        from pns_common.fused.mesh_edges import build_edges

        blocks = kernel_blocks(available_threads())
        edges = build_edges(faces.astype(np.int32), len(points), blocks)
        normals = measured_normals(points, edges.faces, blocks)
        rows = crease_line_rows(points, edges, normals, float(angle), blocks)
        return edges.edges[rows].astype(np.int64)
    topology = build_topology(faces, len(points))
    normals = face_normals(points, faces)
    return topology.edges[line_rows(points, normals, topology, float(angle))]


def named_on(mesh: Mesh, creases: Creases) -> Creases:
    """Return creases with the lines that they look for found on a mesh, by name."""
    if creases.line_angle is None:
        return creases
    return Creases(crease_lines(mesh, creases.line_angle), levels=creases.levels)
