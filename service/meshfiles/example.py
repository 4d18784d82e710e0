"""`pns example`: a coarse mechanical part, made by code, that subdivision can work on."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from .glb import triangles_glb
from .mesh_file import UV, MeshFile, of_triangles

TEETH = 12
# Along the rim each tooth has two columns in its valley and two on its crest.
CREST = (0.0, 0.0, 1.0, 1.0)
TOOTH_HEIGHT = 0.13

# (radius, height, share of the tooth height), once around the section of a toothed pulley with a
# hub and a bore: underside, rim, flange, fillet, hub, chamfers, bore.
SECTION = np.array(
    [
        (0.40, -0.30, 0.0),
        (0.58, -0.30, 0.0),
        (0.76, -0.30, 0.0),
        (0.93, -0.28, 0.4),
        (1.00, -0.20, 1.0),
        (1.00, 0.00, 1.0),
        (1.00, 0.12, 1.0),
        (0.93, 0.20, 0.4),
        (0.78, 0.22, 0.0),
        (0.68, 0.24, 0.0),
        (0.62, 0.30, 0.0),
        (0.60, 0.40, 0.0),
        (0.60, 0.52, 0.0),
        (0.56, 0.60, 0.0),
        (0.48, 0.62, 0.0),
        (0.40, 0.62, 0.0),
        (0.36, 0.57, 0.0),
        (0.36, 0.30, 0.0),
        (0.36, 0.00, 0.0),
        (0.36, -0.25, 0.0),
    ]
)

STEEL = {
    "name": "steel",
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.55, 0.62, 0.72, 1.0],
        "metallicFactor": 0.6,
        "roughnessFactor": 0.35,
    },
}


def part_glb() -> bytes:
    """Return the part as a GLB with normals, texture coordinates and a material."""
    mesh = part()
    normals = _smooth_normals(mesh)
    shaded = of_triangles(mesh.vertices, mesh.faces, mesh.layers[UV].values, normals)
    return triangles_glb(shaded, material=STEEL)


def part() -> MeshFile:
    """Return a closed surface of genus 1: the section swept around y, cut at the UV seams."""
    columns, rows = TEETH * len(CREST), len(SECTION)
    # One column and one row more than the surface has: the seams' second sides.
    column, row = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    radius, height, share = SECTION[row % rows].transpose(2, 0, 1)
    radius = radius + TOOTH_HEIGHT * share * np.array(CREST)[column % len(CREST)]
    # Taken modulo the full turn, so that both sides of the seam are equal to the last bit.
    angle = 2 * np.pi * (column % columns) / columns
    vertices = np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=-1)
    uv = np.stack([column / columns, _arc_length()[row]], axis=-1)
    return of_triangles(vertices.reshape(-1, 3), _faces(columns, rows), uv.reshape(-1, 2))


def _faces(columns: int, rows: int) -> Int[np.ndarray, "F 3"]:
    column, row = np.divmod(np.arange(columns * rows), rows)
    here = column * (rows + 1) + row
    across, up = here + rows + 1, here + 1
    beyond = across + 1
    return np.concatenate(
        [np.stack([here, up, beyond], axis=1), np.stack([here, beyond, across], axis=1)]
    )


def _arc_length() -> Float[np.ndarray, " R"]:
    """Return the length along the section at its points and back at the first, 0 to 1."""
    closed = np.vstack([SECTION, SECTION[:1]])[:, :2]
    steps = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()


def _smooth_normals(triangles: MeshFile) -> Float[np.ndarray, "N 3"]:
    """Return area-weighted normals, equal on both sides of the seams."""
    _, welded = np.unique(triangles.vertices, axis=0, return_inverse=True)
    a, b, c = triangles.vertices[triangles.faces].transpose(1, 0, 2)
    total = np.zeros_like(triangles.vertices)
    np.add.at(total, welded.reshape(-1)[triangles.faces], np.cross(b - a, c - a)[:, None])
    normals = total[welded.reshape(-1)]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
