"""The paper's data sets: seeded draws of surface parameters, each with its coarse patch.

The draws are exact: the published instances come out again to float32 rounding.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int

from pns_common import Mesh
from train.surfaces.implicit import Ridge, Saddle, SphereRidge, Surface


@dataclass(frozen=True, slots=True)
class Instance:
    """A coarse mesh whose vertices lie on an analytic surface."""

    surface: Surface
    mesh: Mesh


@dataclass(frozen=True, slots=True)
class Dataset:
    """Named instances of one family; the name says family and purpose."""

    name: str
    instances: tuple[Instance, ...]


def ridge_training() -> Dataset:
    """Return the 20 training ridges."""
    return Dataset("ridge-training", draw_ridges(seed=42, count=20))


def ridge_held_out() -> Dataset:
    """Return the 10 held-out ridges, on which every headline number is measured."""
    return Dataset("ridge-held-out", draw_ridges(seed=999, count=10))


def saddle_training() -> Dataset:
    """Return the 12 training saddles."""
    return Dataset("saddle-training", draw_saddles(seed=10000, count=12))


def saddle_held_out() -> Dataset:
    """Return the 4 held-out saddles."""
    return Dataset("saddle-held-out", draw_saddles(seed=11000, count=4))


def sphere_ridge_held_out() -> Dataset:
    """Return the 10 ridges on spheres; nothing is trained on this family."""
    return Dataset("sphere-ridge-held-out", draw_sphere_ridges(seed=2999, count=10))


def draw_ridges(seed: int, count: int) -> tuple[Instance, ...]:
    """Draw ridges with a in [0.3, 0.8], b in [3, 10], φ in [0, π], centre in ± 0.1."""
    rng = np.random.default_rng(seed)
    instances = []
    # One generator serves all instances in turn, so the draws cannot be vectorised.
    for index in range(count):
        amplitude, sharpness = rng.uniform(0.3, 0.8), rng.uniform(3, 10)
        angle = rng.uniform(0, np.pi)
        centre_x, centre_y = rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)
        surface = Ridge(amplitude, sharpness, angle, centre_x, centre_y)
        instances.append(Instance(surface, _lift_graph(surface, seed + index)))
    return tuple(instances)


def draw_saddles(seed: int, count: int) -> tuple[Instance, ...]:
    """Draw saddles with a in [0.3, 0.6], centre in ± 0.1."""
    rng = np.random.default_rng(seed)
    instances = []
    for index in range(count):
        amplitude = rng.uniform(0.3, 0.6)
        surface = Saddle(amplitude, rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1))
        instances.append(Instance(surface, _lift_graph(surface, seed + index)))
    return tuple(instances)


def draw_sphere_ridges(seed: int, count: int) -> tuple[Instance, ...]:
    """Draw ridges on the unit sphere with a in [0.04, 0.12], b in [15, 60], φ in [0, π]."""
    rng = np.random.default_rng(seed)
    instances = []
    for index in range(count):
        amplitude, sharpness = rng.uniform(0.04, 0.12), rng.uniform(15, 60)
        surface = SphereRidge(1.0, amplitude, sharpness, rng.uniform(0, np.pi))
        longitude, latitude = (jittered_grid(seed + index, jitter=0.03) / 2).unbind(-1)
        direction = torch.stack(
            [
                latitude.cos() * longitude.cos(),
                latitude.cos() * longitude.sin(),
                latitude.sin(),
            ],
            dim=-1,
        )
        vertices = direction * surface.reach(direction)[:, None]
        instances.append(Instance(surface, _mesh(vertices)))
    return tuple(instances)


def _lift_graph(surface: Ridge | Saddle, seed: int) -> Mesh:
    plane = jittered_grid(seed, jitter=0.04)
    height = surface.height(torch.nn.functional.pad(plane, (0, 1)))
    return _mesh(torch.cat([plane, height[:, None]], dim=-1))


def _mesh(vertices: Float[torch.Tensor, "V 3"]) -> Mesh:
    # The published vertices are float32; the geometry from here on is float64.
    return Mesh(vertices.numpy().astype(np.float64), grid_faces())


DATASETS: Mapping[str, Callable[[], Dataset]] = {
    "ridge-training": ridge_training,
    "ridge-held-out": ridge_held_out,
    "saddle-training": saddle_training,
    "saddle-held-out": saddle_held_out,
    "sphere-ridge-held-out": sphere_ridge_held_out,
}


# Vertices along one side of the patch.
SIDE = 9


def grid_faces() -> Int[np.ndarray, "F 3"]:
    """Return the 128 faces; vertex i·9 + j stands at (x_i, y_j).

    The quad (i, j) gives (v00, v10, v11) and (v00, v11, v01), so all diagonals run one way and
    normals point to +z.
    """
    i, j = (axis.ravel() for axis in np.mgrid[: SIDE - 1, : SIDE - 1])
    v00 = i * SIDE + j
    v10, v11, v01 = v00 + SIDE, v00 + SIDE + 1, v00 + 1
    halves = np.stack([np.stack([v00, v10, v11], -1), np.stack([v00, v11, v01], -1)], axis=1)
    return halves.reshape(-1, 3).astype(np.int64)


def jittered_grid(seed: int, jitter: float) -> Float[torch.Tensor, "81 2"]:
    """Return the patch's (x, y) in float32, interior vertices moved by (u − ½) · jitter · 2/9.

    u is `torch.rand(81, 2)`: the published draws come from torch's float32 generator, so nothing
    else reproduces them.
    """
    axis = torch.linspace(-1, 1, SIDE)
    points = torch.cartesian_prod(axis, axis)
    draws = torch.rand(SIDE * SIDE, 2, generator=torch.Generator().manual_seed(seed))
    offsets = (draws - 0.5) * jitter * (2 / SIDE)
    interior = (points.abs() < 1).all(dim=-1, keepdim=True)
    return torch.where(interior, points + offsets, points)
