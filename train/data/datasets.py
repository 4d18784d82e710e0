"""The paper's data sets: seeded draws of surface parameters, each with its coarse patch.

The draws are exact: the published instances come out again to float32 rounding.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import torch
from jaxtyping import Float

from pns_common import Mesh
from train.data.grid import grid_faces, jittered_grid
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


DATASETS: Mapping[str, Callable[[], Dataset]] = MappingProxyType(
    {
        "ridge-training": ridge_training,
        "ridge-held-out": ridge_held_out,
        "saddle-training": saddle_training,
        "saddle-held-out": saddle_held_out,
        "sphere-ridge-held-out": sphere_ridge_held_out,
    }
)
