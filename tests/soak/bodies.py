"""Meshes that clients send, well-meaning or not; made without loading what refines them."""

from __future__ import annotations

import numpy as np

from service.meshfiles.example import part
from service.meshfiles.glb import triangles_glb
from service.meshfiles.mesh_file import MeshFile, of_triangles


def a_part(number: int) -> MeshFile:
    """The example's part; no two numbers have one shape."""
    mesh = part()
    rng = np.random.default_rng(number)
    moved = mesh.vertices + 1e-3 * rng.standard_normal(mesh.vertices.shape)
    return of_triangles(moved, mesh.faces)


def large_body() -> bytes:
    """A part whose refinement takes seconds at four levels."""
    return triangles_glb(a_part(99))


def small_body() -> bytes:
    """A tetrahedron."""
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    return triangles_glb(of_triangles(vertices, faces))
