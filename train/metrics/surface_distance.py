"""Distances and angles between normals of two triangle meshes as surfaces, both ways."""

from dataclasses import dataclass, fields

import igl
import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh
from train.vectors import dot, face_normals, norm

SEED = 0


@dataclass(frozen=True, eq=False, slots=True)
class FaceTree:
    """A mesh's triangles in a tree of boxes."""

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    boxes: igl.AABB


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """For each point the distance to the mesh, the nearest point of it, and a face it lies on."""

    distance: Float[np.ndarray, " P"]
    point: Float[np.ndarray, "P 3"]
    face: Int[np.ndarray, " P"]


def face_tree(mesh: Mesh) -> FaceTree:
    """Return the tree of a mesh."""
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    boxes = igl.AABB()
    boxes.init(vertices, faces)
    return FaceTree(vertices, faces, boxes)


def nearest(tree: FaceTree, points: Float[np.ndarray, "P 3"]) -> Nearest:
    """Return the nearest point of the mesh to each point, in the mesh's unit.

    On an edge or at a vertex the face is one of those that meet there.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    square, face, point = tree.boxes.squared_distance(tree.vertices, tree.faces, points)
    return Nearest(np.sqrt(square), np.asarray(point), np.asarray(face))


@dataclass(frozen=True, slots=True)
class SurfaceErrors:
    """Errors of a surface against the true one; lengths in the true one's bounding-box diagonal.

    Attributes:
        mean: mean distance of a surface's points from the other surface, mean of both ways.
        p95: 95th percentile of that distance, mean of both ways.
        hausdorff: the largest distance of a sample point or a vertex, of both ways.
        normal: mean angle between the faces at a point and at its nearest point (on an edge, one
            of its faces), mean of both ways, radians.
    """

    mean: float
    p95: float
    hausdorff: float
    normal: float


SURFACE_METRICS = tuple(field.name for field in fields(SurfaceErrors))


@dataclass(frozen=True, eq=False, slots=True)
class Surface:
    """A mesh, prepared to be measured from and to.

    Attributes:
        normals: of its faces; zero where a face has no area.
        points: sample points, evenly by area.
        faces: the faces that they lie in.
    """

    tree: FaceTree
    normals: Float[np.ndarray, "F 3"]
    points: Float[np.ndarray, "P 3"]
    faces: Int[np.ndarray, " P"]

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal."""
        return float(np.linalg.norm(np.ptp(self.tree.vertices, axis=0)))


def prepared(mesh: Mesh, samples: int) -> Surface:
    """Return a mesh with its tree and so many sample points; the same mesh gives the same ones."""
    tree = face_tree(mesh)
    points, faces = surface_samples(tree, samples, np.random.default_rng(SEED))
    return Surface(tree, face_normals(tree.vertices, tree.faces), points, faces)


def surface_samples(
    mesh: Mesh | FaceTree, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return points spread evenly by area, and their faces.

    Stratified: one point in each of `count` pieces of equal area, in the order of the faces. Means
    over two refinements of one mesh then differ by their surfaces, and hardly by the draw.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    upto = np.cumsum(norm(np.cross(b - a, c - a)))
    place = (np.arange(count) + rng.random(count)) / count * upto[-1]
    face = np.searchsorted(upto, place, side="right").clip(max=len(upto) - 1)
    u, v = rng.random((2, count, 1))
    # The far half of the parallelogram is turned onto the triangle.
    far = u + v > 1
    u, v = np.where(far, 1 - u, u), np.where(far, 1 - v, v)
    return a[face] + u * (b - a)[face] + v * (c - a)[face], face


def surface_errors(true: Surface, refined: Surface) -> SurfaceErrors:
    """Measure a surface against the true one."""
    there, back = _one_way(refined, true), _one_way(true, refined)
    return SurfaceErrors(
        mean=(there.mean + back.mean) / 2 / true.diagonal,
        p95=(there.p95 + back.p95) / 2 / true.diagonal,
        hausdorff=max(there.hausdorff, back.hausdorff) / true.diagonal,
        normal=(there.normal + back.normal) / 2,
    )


def _one_way(source: Surface, target: Surface) -> SurfaceErrors:
    """Measure from one surface to the other, in the surfaces' own unit."""
    closest = nearest(target.tree, source.points)
    here, there = source.normals[source.faces], target.normals[closest.face]
    angle = np.arctan2(norm(np.cross(here, there)), dot(here, there))
    at_vertices = nearest(target.tree, source.tree.vertices).distance
    return SurfaceErrors(
        mean=float(closest.distance.mean()),
        p95=float(np.percentile(closest.distance, 95)),
        hausdorff=float(max(closest.distance.max(), at_vertices.max())),
        normal=float(angle.mean()),
    )


def gain(reference: SurfaceErrors, errors: SurfaceErrors) -> dict[str, float]:
    """Return for each metric by how many per cent errors are below the reference's."""
    return {
        metric: 100 * (1 - getattr(errors, metric) / getattr(reference, metric))
        for metric in SURFACE_METRICS
    }
