"""The meshes that certificates look at; all have the reference length 1 or near it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from pns_common import Mesh, MeshError, clean
from pns_common.reference_length import measure_reference_length
from train.data.datasets import draw_ridges, grid_faces, jittered_grid
from train.spectra.stars import star

MESH_ENDINGS = (".obj", ".off", ".ply", ".stl")


@dataclass(frozen=True, slots=True)
class Body:
    """A named mesh."""

    name: str
    mesh: Mesh


def synthetic_bodies(seed: int) -> tuple[Body, ...]:
    """Return the paper's battery, shape-regular: a paraboloid, a bumpy sphere and a ridge."""
    (ridge,) = draw_ridges(seed=999, count=1)
    return (
        Body("paraboloid", paraboloid(seed)),
        Body("bumpy sphere", bumpy_sphere(seed)),
        Body("ridge", ridge.mesh),
    )


def paraboloid(seed: int) -> Mesh:
    """Return z = 0.6 x² + 0.4 y² over the jittered patch: every vertex curved, boundaries."""
    plane = jittered_grid(seed, jitter=0.4).numpy().astype(np.float64)
    height = 0.6 * plane[:, 0] ** 2 + 0.4 * plane[:, 1] ** 2
    return Mesh(np.column_stack([plane, height]), grid_faces())


def bumpy_sphere(seed: int) -> Mesh:
    """Return a sphere of 320 faces with bumps of 15 %: closed, valences 5 and 6."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    directions = np.asarray(sphere.vertices, dtype=np.float64)
    waves = 3 * np.random.default_rng(seed).standard_normal((3, 3))
    bumps = 1 + 0.05 * np.sin(directions @ waves).sum(axis=1, keepdims=True)
    return Mesh(directions * bumps, np.asarray(sphere.faces, dtype=np.int64))


def spiky_sphere(seed: int) -> Mesh:
    """Return a sphere of 320 faces with radii of 0.1 to 1.9: what is added to Loop would fold it.

    On smooth bodies a trained rule turns no face far enough for the fold guard to act.
    """
    sphere = trimesh.creation.icosphere(subdivisions=2)
    directions = np.asarray(sphere.vertices, dtype=np.float64)
    radii = np.random.default_rng(seed).uniform(0.1, 1.9, (len(directions), 1))
    return Mesh(directions * radii, np.asarray(sphere.faces, dtype=np.int64))


def bumpy_torus(seed: int) -> Mesh:
    """Return a torus of 12 × 6 quads, halved: closed and every vertex regular."""
    around, across = 12, 6
    u, v = (axis.ravel() for axis in np.mgrid[:around, :across])
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, 2)
    alpha, beta = 2 * np.pi * u / around, 2 * np.pi * v / across
    tube = 0.4 * (1 + 0.15 * np.sin(3 * alpha + phase[0]) * np.cos(beta + phase[1]))
    ring = 1 + tube * np.cos(beta)
    points = np.stack([ring * np.cos(alpha), ring * np.sin(alpha), tube * np.sin(beta)], axis=-1)

    def number(i: Int[np.ndarray, " N"], j: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
        return (i % around) * across + j % across

    quad = [number(u, v), number(u + 1, v), number(u + 1, v + 1), number(u, v + 1)]
    faces = [np.stack([quad[0], quad[1], quad[2]], -1), np.stack([quad[0], quad[2], quad[3]], -1)]
    return Mesh(points, np.concatenate(faces).astype(np.int64))


def flat_bodies(seed: int) -> tuple[Body, ...]:
    """Return planar meshes in z = 0, none folded: a grid, one of any valences, stars."""
    plane = jittered_grid(seed, jitter=0.4).numpy().astype(np.float64)
    # Triangles too thin would fold over in the plane once Loop has moved them.
    scattered = jittered_grid(seed + 1, jitter=1.2).numpy().astype(np.float64)
    return (
        Body("flat grid", Mesh(_lay(plane), grid_faces())),
        Body("flat Delaunay", Mesh(_lay(scattered), Delaunay(scattered).simplices)),
        *(Body(f"flat star {k}", star(k, rings=2, spoke=0.5).mesh) for k in (3, 7, 12)),
    )


def real_bodies(folder: Path) -> tuple[Body, ...]:
    """Read the mesh files of a folder, cleaned, centred and scaled to the reference length 1.

    Raises:
        MeshError: the folder has no mesh file.
    """
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in MESH_ENDINGS)
    if not paths:
        raise MeshError(f"no {', '.join(MESH_ENDINGS)} file in {folder}", element="folder")
    return tuple(Body(path.stem, _read(path)) for path in paths)


def random_motion(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw a rotation, uniform over all, and a translation of about the meshes' size."""
    # A normalised Gaussian quaternion is uniform.
    return Rotation.from_quat(rng.standard_normal(4)).as_matrix(), rng.standard_normal(3)


def _read(path: Path) -> Mesh:
    # Vertices at one place are one vertex: a seam would be a boundary.
    loaded = trimesh.load_mesh(path, process=False)
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    mesh = clean(Mesh(np.asarray(loaded.vertices), np.asarray(loaded.faces))).mesh
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    return Mesh(
        centred / measure_reference_length(mesh.vertices, mesh.faces.reshape(-1)), mesh.faces
    )


def _lay(plane: Float[np.ndarray, "V 2"]) -> Float[np.ndarray, "V 3"]:
    return np.column_stack([plane, np.zeros(len(plane))])
