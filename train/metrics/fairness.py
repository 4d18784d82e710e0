"""How much a surface bends in all, ∫ (κ₁² + κ₂²) dA, and the volume that it encloses."""

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.vectors import dot, norm, unit

# Faces with twice their area below this share of their squared sides are left out.
NO_AREA = 1e-12


def bending(mesh: Mesh, normals: Float[np.ndarray, "V 3"] | None = None) -> float:
    """Return ∫ ‖∇n‖² dA = ∫ (κ₁² + κ₂²) dA of the vertex normals, linear over each face.

    It has no unit: a sphere has 8π at any size. Without `normals` they are the faces' mean by area.
    """
    normals = vertex_normals(mesh) if normals is None else normals
    corners, corner_normals = mesh.vertices[mesh.faces], normals[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    twice = norm(np.cross(sides[:, 0], -sides[:, 2]))
    square = (sides**2).sum(axis=2)
    defined = twice > NO_AREA * square.sum(axis=1)
    total = 0.0
    for side in range(3):
        opposite = -(sides[:, (side + 1) % 3] * sides[:, (side + 2) % 3]).sum(axis=1)
        change = ((corner_normals[:, (side + 1) % 3] - corner_normals[:, side]) ** 2).sum(axis=1)
        total += float((opposite / np.where(defined, twice, np.inf) * change).sum()) / 2
    return total


def vertex_normals(mesh: Mesh) -> Float[np.ndarray, "V 3"]:
    """Return unit normals, the faces' mean by area; zero where there is none."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    area, corners = np.repeat(np.cross(b - a, c - a), 3, axis=0), mesh.faces.reshape(-1)
    count = len(mesh.vertices)
    return unit(np.stack([np.bincount(corners, component, count) for component in area.T], axis=1))


def volume(mesh: Mesh) -> float:
    """Return the signed volume of a closed mesh, seen from its centroid."""
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    a, b, c = (centred[mesh.faces[:, corner]] for corner in range(3))
    return float(dot(a, np.cross(b, c)).sum()) / 6
