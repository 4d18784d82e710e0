"""The meshes that certificates look at; all have the reference length 1 or near it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from pns_common import Mesh, MeshError, clean
from pns_common.mesh.reference_length import measure_reference_length
from train.data.datasets import draw_ridges, grid_faces, jittered_grid
from train.spectra.stars import quad_star, star

MESH_ENDINGS = (".obj", ".off", ".ply", ".stl")


@dataclass(frozen=True, slots=True)
class Body:
    """A named mesh."""

    name: str
    mesh: Mesh


@dataclass(frozen=True, slots=True)
class Bodies:
    """The meshes that rules over one base scheme are certified on.

    Attributes:
        shaped: of many kinds of vertices and faces, well-shaped.
        flat: in the plane z = 0, none folded.
        rough: one that would fold without a guard.
        regular: closed, and every vertex regular.
        coarse: of few faces and sharp edges, so that it can be refined until none is kept sharp.
    """

    shaped: tuple[Body, ...]
    flat: tuple[Body, ...]
    rough: Body
    regular: Mesh
    coarse: Body


def triangle_bodies(seed: int) -> Bodies:
    """Return the meshes for rules over Loop."""
    rough, coarse = Body("spiky sphere", spiky_sphere(seed)), capped_prism(4).triangulated()
    shaped, flat = synthetic_bodies(seed), flat_bodies(seed)
    return Bodies(shaped, flat, rough, bumpy_torus(seed), Body("prism of triangles", coarse))


def polygon_bodies(seed: int) -> Bodies:
    """Return the meshes for rules over Catmull–Clark."""
    rng, halves, torus = np.random.default_rng(seed), paraboloid(seed), quad_torus(seed)
    quads = halves.faces.reshape(-1, 6)[:, [0, 1, 2, 5]]

    def shaken(mesh: Mesh, by: float) -> Mesh:
        noise = by * rng.standard_normal(mesh.vertices.shape)
        return Mesh(mesh.vertices + noise, mesh.polygons)

    return Bodies(
        shaped=(
            Body("paraboloid", Mesh(halves.vertices, quads)),
            Body("torus", shaken(torus, 0.06)),
            Body("prism", shaken(capped_prism(7), 0.06)),
        ),
        flat=(
            Body("flat grid", Mesh(halves.vertices * [1, 1, 0], quads)),
            *(Body(f"flat star {k}", quad_star(k, 2, 0.5).mesh) for k in (3, 7, 12)),
        ),
        rough=Body("spiky torus", shaken(torus, 0.3)),
        regular=torus,
        coarse=Body("small prism", capped_prism(4)),
    )


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
    whole = quad_torus(seed)
    halves = np.concatenate([whole.faces[:, [0, 1, 2]], whole.faces[:, [0, 2, 3]]])
    return Mesh(whole.vertices, halves)


def quad_torus(seed: int) -> Mesh:
    """Return a torus of 12 × 6 quads: closed and every vertex regular."""
    around, across = 12, 6
    u, v = (axis.ravel() for axis in np.mgrid[:around, :across])
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, 2)
    alpha, beta = 2 * np.pi * u / around, 2 * np.pi * v / across
    tube = 0.4 * (1 + 0.15 * np.sin(3 * alpha + phase[0]) * np.cos(beta + phase[1]))
    ring = 1 + tube * np.cos(beta)
    points = np.stack([ring * np.cos(alpha), ring * np.sin(alpha), tube * np.sin(beta)], axis=-1)

    def number(i: Int[np.ndarray, " N"], j: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
        return (i % around) * across + j % across

    quads = [number(u, v), number(u + 1, v), number(u + 1, v + 1), number(u, v + 1)]
    return Mesh(points, np.stack(quads, axis=-1))


def capped_prism(sides: int) -> Mesh:
    """Return a prism with a polygon at one end and a pyramid of triangles at the other."""
    angle, i = 2 * np.pi * np.arange(sides) / sides, np.arange(sides)
    ring, after = np.stack([np.cos(angle), np.sin(angle)], axis=1), (i + 1) % sides
    ends = [np.column_stack([ring, np.full(sides, z)]) for z in (-0.5, 0.5)]
    walls = np.stack([i, after, sides + after, sides + i], axis=1).tolist()
    roof = np.stack([sides + i, sides + after, np.full(sides, 2 * sides)], axis=1).tolist()
    return Mesh(np.concatenate([*ends, [[0, 0, 1.0]]]), [i[::-1].tolist(), *walls, *roof])


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

    Polygons of an OBJ stay; those of other files are cut into triangles.

    Raises:
        MeshError: the folder has no mesh file, or one that holds no mesh; the error names it.
    """
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in MESH_ENDINGS)
    if not paths:
        raise MeshError(f"no {', '.join(MESH_ENDINGS)} file in {folder}", element="folder")
    return tuple(Body(path.name, _read(path)) for path in paths)


def random_motion(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw a rotation, uniform over all, and a translation of about the meshes' size."""
    # A normalised Gaussian quaternion is uniform.
    return Rotation.from_quat(rng.standard_normal(4)).as_matrix(), rng.standard_normal(3)


def _read(path: Path) -> Mesh:
    try:
        if path.suffix.lower() == ".obj":
            mesh = Mesh.load(path)
        else:
            loaded = trimesh.load_mesh(path, process=False)
            mesh = Mesh(np.asarray(loaded.vertices), np.asarray(loaded.faces))
        # Vertices at one place are one vertex: a seam would be a boundary.
        places, number = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)
        mesh = clean(Mesh(places, (number.reshape(-1)[mesh.corners], mesh.offsets))).mesh
    except Exception as error:  # on a broken file trimesh fails as it comes
        raise MeshError(f"{path}: {error}") from error
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    scale = measure_reference_length(mesh.vertices, mesh.corners)
    return Mesh(centred / scale, (mesh.corners, mesh.offsets))


def _lay(plane: Float[np.ndarray, "V 2"]) -> Float[np.ndarray, "V 3"]:
    return np.column_stack([plane, np.zeros(len(plane))])
