"""Coarse meshes beside the surface that they stand for, and the simplest makers of such pairs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh, MeshError, loop, refine
from train.data.dense_meshes import is_manifold
from train.data.icosphere import icosphere
from train.data.remeshers import with_points
from train.data.simplifiers import SIMPLIFIERS, fast_quadric
from train.data.stream import random_patch
from train.surfaces.implicit import unit_normal


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """A surface as many points on it, with its unit normals there."""

    points: Float[np.ndarray, "P 3"]
    normals: Float[np.ndarray, "P 3"]


@dataclass(frozen=True, eq=False, slots=True)
class Pair:
    """A coarse mesh and its surface; the kind says where it comes from."""

    kind: str
    coarse: Mesh
    surface: Reference


# Dense vertices and faces, and a number of faces, to a coarse mesh; None where it is spoilt.
Coarsen = Callable[[np.ndarray, np.ndarray, int, np.random.Generator], Mesh | None]


def moved(pair: Pair, linear: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, " 3"]) -> Pair:
    """Return a pair under p ↦ p · linear + shift; linear turns, or scales evenly."""
    turn = linear / np.cbrt(np.linalg.det(linear))
    return Pair(
        pair.kind,
        with_points(pair.coarse, pair.coarse.vertices @ linear + shift),
        Reference(pair.surface.points @ linear + shift, pair.surface.normals @ turn),
    )


# How often it is an icosphere; and collapsed with its vertices laid back onto the surface.
ICOSPHERE, ON_SURFACE = 0.4, 0.3

DENSE_SPLITS, MOST_SPLITS = 5, 3
FEWEST, MOST = 12, 2500
ROUND = 0.5


def sphere_pair(rng: np.random.Generator, coarsen: Coarsen | None = None) -> Pair | None:
    """Return a coarse mesh of a sphere, or of an ellipsoid; None where collapses spoilt it."""
    dense = icosphere(DENSE_SPLITS)
    axes = np.ones(3) if rng.random() < ROUND else 1 + rng.uniform(-0.4, 0.4, 3)
    kind = rng.random()
    if kind < ICOSPHERE:
        coarse = icosphere(int(rng.integers(0, MOST_SPLITS + 1)))
        coarse = with_points(coarse, coarse.vertices * axes)
    else:
        count = int(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST))))
        coarse = (coarsen or coarsened)(dense.vertices * axes, dense.faces, count, rng)
        if coarse is not None and kind < ICOSPHERE + ON_SURFACE:
            unit = coarse.vertices / axes
            unit /= np.linalg.norm(unit, axis=1, keepdims=True)
            coarse = with_points(coarse, unit * axes)
    if coarse is None:
        return None
    return Pair("sphere", coarse, _ellipsoid(dense, axes))


def ball_pair(rng: np.random.Generator) -> Pair:
    """Return an icosahedron, or one split once, and the sphere through its corners."""
    coarse = icosphere(int(rng.integers(2)))
    return Pair("ball", coarse, _ellipsoid(icosphere(DENSE_SPLITS), np.ones(3)))


def _ellipsoid(sphere: Mesh, axes: Float[np.ndarray, " 3"]) -> Reference:
    normals = sphere.vertices / axes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Reference(sphere.vertices * axes, normals)


LEVELS, PROJECTIONS = 3, 4


def patch_pair(rng: np.random.Generator) -> Pair:
    """Return a patch of `train.data.stream`, its surface by Loop's mesh laid onto it."""
    surface, coarse = random_patch(rng)
    points = refine(coarse, loop(), LEVELS, limit=False, threads=1).mesh.vertices
    for _ in range(PROJECTIONS):
        slope = surface.gradient(points)
        points = points - (surface.value(points) / (slope**2).sum(axis=1))[:, None] * slope
    reference = Reference(points, unit_normal(surface, points))
    return Pair("patch", coarse, reference)


# How often each of `train.data.simplifiers`. Quadrics leave vertices outside of round surfaces, the
# others on them, as most meshes are that no simplifier made: the stream has about as many of each.
WAYS = {
    "fast-quadric": 0.4,
    "MeshLab": 0.3,
    "MeshLab, own vertices": 0.05,
    "VTK": 0.15,
    "pyacvd": 0.05,
    "isotropic": 0.05,
}

# How fast the sweeps' threshold may rise.
AGGRESSIVENESS = (3.0, 5.0, 7.0)

FEWEST = 8


def coarsened(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    count: int,
    rng: np.random.Generator,
) -> Mesh | None:
    """Return a mesh of about `count` faces; None where it is no manifold any more."""
    way = str(rng.choice(list(WAYS), p=list(WAYS.values())))
    aggressiveness = float(rng.choice(AGGRESSIVENESS))
    dense = Mesh(points, faces)
    try:
        if way == "fast-quadric":
            mesh = fast_quadric(dense, count, aggressiveness)
        else:
            mesh = SIMPLIFIERS[way](dense, count)
    except MeshError:
        return None
    return mesh if len(mesh.faces) >= FEWEST and is_manifold(mesh) else None
