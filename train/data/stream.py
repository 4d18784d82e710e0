"""Random coarse meshes on random surfaces of several families."""

from collections.abc import Callable
from dataclasses import dataclass

import fast_simplification
import numpy as np
from jaxtyping import Float

from pns_common import Mesh, clean
from train.data.plane_meshes import PlaneMesh, regular_grid, scattered, turned_grid
from train.surfaces.implicit import Ridge, Saddle
from train.surfaces.smooth import Bump, CurvedRidge, Fillet, LumpySphere

# From how far, and in how many steps, a patch is moved onto a fillet.
START, MARCHES = 4.0, 400

Graph = Ridge | CurvedRidge | Bump | Saddle
Surface = Graph | LumpySphere | Fillet
Lift = Callable[[Float[np.ndarray, "P 2"]], Float[np.ndarray, "P 3"]]


@dataclass(frozen=True, slots=True)
class Drawn:
    """A surface, and how a plane mesh over [−1, 1]² is lifted onto it."""

    surface: Surface
    lift: Lift


def ridge(rng: np.random.Generator) -> Drawn:
    """Draw a ridge of the paper's family."""
    surface = Ridge(
        amplitude=rng.uniform(0.2, 0.85),
        sharpness=rng.uniform(2.5, 11),
        angle=rng.uniform(0, np.pi),
        centre_x=rng.uniform(-0.3, 0.3),
        centre_y=rng.uniform(-0.3, 0.3),
    )
    return _graph(surface)


def curved_ridge(rng: np.random.Generator) -> Drawn:
    """Draw a ridge along an arc or a whole circle, its centre in the patch.

    Where the circle is small, the surface comes to a faint tip at its centre.
    """
    surface = CurvedRidge(
        amplitude=rng.uniform(0.2, 0.7),
        sharpness=rng.uniform(3, 10),
        radius=rng.uniform(0.5, 1.5),
        centre_x=rng.uniform(-1, 1),
        centre_y=rng.uniform(-1, 1),
    )
    return _graph(surface)


def bump(rng: np.random.Generator) -> Drawn:
    """Draw a bump, from round to twice as long as wide."""
    surface = Bump(
        amplitude=rng.uniform(0.2, 0.7),
        sharpness=rng.uniform(1.5, 7),
        elongation=rng.uniform(0.2, 1),
        angle=rng.uniform(0, np.pi),
        centre_x=rng.uniform(-0.4, 0.4),
        centre_y=rng.uniform(-0.4, 0.4),
    )
    return _graph(surface)


def saddle(rng: np.random.Generator) -> Drawn:
    """Draw one of the paper's saddles, on which Loop is hard to beat."""
    surface = Saddle(rng.uniform(0.2, 0.7), rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2))
    return _graph(surface)


def lumpy_sphere(rng: np.random.Generator) -> Drawn:
    """Draw a part of a sphere with waves; the patch is laid on it by central projection."""
    radius = rng.uniform(1.2, 2.5)
    surface = LumpySphere(
        radius,
        amplitude=rng.uniform(0.05, 0.25) * radius,
        frequency=rng.uniform(2, 6),
        phases=(rng.uniform(0, 6.3), rng.uniform(0, 6.3), rng.uniform(0, 6.3)),
    )

    def lift(plane: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, "P 3"]:
        direction = np.concatenate([plane, np.full((len(plane), 1), radius)], axis=1)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        return direction * surface.reach(direction)[:, None]

    return Drawn(surface, lift)


def fillet(rng: np.random.Generator) -> Drawn:
    """Draw two walls at a right angle with a fillet, sharp to wide."""
    surface = Fillet(rng.uniform(0.1, 0.9))
    shift = rng.uniform(-0.25, 0.25)
    turn = rng.uniform(0, np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def lift(plane: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, "P 3"]:
        turned = plane @ rotation + [0, shift]
        sight = np.array([0.0, 1.0, 1.0]) / np.linalg.norm([0.0, 1.0, 1.0])
        up = np.cross(np.array([1.0, 0.0, 0.0]), sight)
        up /= np.linalg.norm(up)
        points = turned[:, :1] * up + turned[:, 1:] * np.cross(sight, up) + START * sight
        for _ in range(MARCHES):
            points = points - surface.value(points)[:, None] * sight
        return points

    return Drawn(surface, lift)


FAMILIES = (ridge, curved_ridge, bump, saddle, lumpy_sphere, fillet)
# How often each family is drawn.
SHARES = (0.28, 0.12, 0.10, 0.30, 0.12, 0.08)


def random_patch(rng: np.random.Generator) -> tuple[Surface, Mesh]:
    """Draw a family, a surface of it, and a coarse mesh on that."""
    family = FAMILIES[rng.choice(len(FAMILIES), p=SHARES)]
    drawn = family(rng)
    kind = rng.choice(4, p=[0.55, 0.15, 0.15, 0.15])
    if kind == 3:
        return drawn.surface, decimated(rng, drawn.lift)
    side = int(rng.integers(8, 12)) if kind else int(rng.choice([9, 9, 9, 8, 10, 11]))
    jitter = rng.uniform(0, 0.5) if kind else rng.choice([0.04, 0.04, 0.3])
    plane = (regular_grid, turned_grid, scattered)[kind](rng, side, jitter)
    return drawn.surface, _mesh(plane, drawn.lift)


def decimated(rng: np.random.Generator, lift: Lift) -> Mesh:
    """Simplify a dense mesh of the surface: vertices of all valences, near the surface."""
    dense = _mesh(regular_grid(rng, 41, 0.3), lift)
    count = int(rng.integers(100, 260))
    points, faces = fast_simplification.simplify(
        dense.vertices.copy(), dense.faces.astype(np.int32), target_count=count
    )[:2]
    return clean(Mesh(np.asarray(points, dtype=np.float64), faces.astype(np.int64))).mesh


def _graph(surface: Graph) -> Drawn:
    def lift(plane: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, "P 3"]:
        flat = np.concatenate([plane, np.zeros((len(plane), 1))], axis=1)
        return np.concatenate([plane, surface.height(flat)[:, None]], axis=1)

    return Drawn(surface, lift)


def _mesh(plane: PlaneMesh, lift: Lift) -> Mesh:
    return Mesh(lift(plane.points), plane.faces)
