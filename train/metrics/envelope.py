"""The best that any network could do inside the envelope.

Whatever the weights, an edge vertex stays in the ball of radius C h² γ round Loop's. The least
|f| / ‖∇f‖ within each ball bounds every distance metric of the whole class of operators.
"""

import numpy as np
from jaxtyping import Float

from pns_common import Scheme
from pns_common.kernels.connectivity import INTERIOR
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.data.datasets import Dataset, Instance
from train.metrics.card import compare_with_loop
from train.metrics.one_step import Improvement
from train.refining import additions
from train.surfaces.implicit import Surface, signed_distance

# What the limit is known for; a normal error has no such bound.
DISTANCE_METRICS = ("distance_near", "distance", "hausdorff_near", "hausdorff")

DIRECTIONS = 96
HALVINGS = 40


def best_in_balls(
    surface: Surface, centres: Float[np.ndarray, "P 3"], radii: Float[np.ndarray, " P"]
) -> Float[np.ndarray, "P 3"]:
    """Return in each ball a point where |f| / ‖∇f‖ is least.

    A pattern search: steps in 96 directions, clipped to the ball, from one radius downwards; the
    step is halved where none of them gains.
    """
    directions = _fibonacci_sphere(DIRECTIONS)
    best = centres.copy()
    least = np.abs(signed_distance(surface, best))
    step = radii.copy()
    for _ in range(HALVINGS):
        trial = best[:, None] + step[:, None, None] * directions - centres[:, None]
        length = np.linalg.norm(trial, axis=-1, keepdims=True)
        reach = radii[:, None, None]
        trial *= np.where(length > reach, reach / np.where(length > 0, length, 1), 1)
        trial += centres[:, None]
        distances = np.abs(signed_distance(surface, trial.reshape(-1, 3))).reshape(trial.shape[:2])
        chosen = distances.argmin(axis=1)
        rows = np.arange(len(best))
        gains = distances[rows, chosen] < least
        best = np.where(gains[:, None], trial[rows, chosen], best)
        least = np.where(gains, distances[rows, chosen], least)
        step = np.where(gains, step, step / 2)
    return best


def oracle(surface: Surface, budget: float, gate_sharpness: float) -> Scheme:
    """Return the scheme that knows the surface and puts each edge vertex where it is best."""

    def rule(level: Level) -> Additions:
        assert level.reference_length is not None  # the library measures it for every rule
        inside = level.topology.edge_class == INTERIOR
        envelope = budget / level.reference_length * inside * level.edges.lengths**2
        gate = np.tanh(gate_sharpness * level.edges.jumps**2)
        placed = level.base.place(level.points, level.topology, level.blocks)
        none, centres = np.zeros(len(level.points)), placed[len(level.points) :]
        best = best_in_balls(surface, centres, envelope * gate)
        moved = np.concatenate([np.zeros_like(level.points), best - centres])
        return additions(
            level, moved, np.concatenate([none, envelope]), np.concatenate([none, gate])
        )

    return Scheme("limit", rule=rule, learned_levels=None)


def envelope_limit(
    dataset: Dataset, budget: float, gate_sharpness: float
) -> dict[str, Improvement]:
    """Return the improvement over Loop that no member of the class can pass, in per cent."""

    def best(instance: Instance) -> Scheme:
        return oracle(instance.surface, budget, gate_sharpness)

    improvements = compare_with_loop(best, dataset)
    return {metric: improvements[metric] for metric in DISTANCE_METRICS}


def _fibonacci_sphere(count: int) -> Float[np.ndarray, "N 3"]:
    """Return directions spread evenly over the sphere."""
    index = np.arange(count) + 0.5
    height = 1 - 2 * index / count
    turn = np.pi * (1 + 5**0.5) * index
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
