"""Training: a recipe in, weights out; the same bits every time on one machine."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import ParameterError
from train.data.batch import Batch, disjoint_union
from train.data.datasets import DATASETS, Instance
from train.fitting.determinism import deterministic
from train.fitting.pairs_trainer import fit_to_pairs
from train.fitting.quiet import quiet_term
from train.models.directed import DirectedNet
from train.models.from_recipe import initial_network, paper_rule
from train.models.networks import BoundedNet
from train.models.recipe import LossWeights, OneStep, OnPairs, Recipe, one_step
from train.reference import Step
from train.surfaces.implicit import signed_distance, unit_normal
from train.tensors import dot, unit

# Called after each step with the number of steps done and the loss.
OnStep = Callable[[int, float], None]

Loss = Callable[[BoundedNet, Batch], Float[Tensor, ""]]


@dataclass(frozen=True, slots=True)
class Fit:
    """A trained float32 network and the loss before each step."""

    network: BoundedNet | DirectedNet
    losses: tuple[float, ...]


def fit(recipe: Recipe, on_step: OnStep, folders: tuple[Path, Path] | None = None) -> Fit:
    """Train the operator with Adam, on what the recipe says.

    Args:
        recipe: what to train.
        on_step: called after each step with the number of steps done and the loss.
        folders: of prepared shapes and of pairs, for recipes that train on stored pairs.

    Raises:
        ParameterError: the recipe trains on stored pairs, and no folders are given.
    """
    match recipe.training:
        case OnPairs() as plan:
            if folders is None or recipe.directed is None:
                raise ParameterError("folders", folders, expected="folders of shapes and pairs")
            return Fit(*fit_to_pairs(recipe, recipe.directed, plan, folders, on_step))
        case OneStep():
            quiet = with_quiet(recipe, lambda network, batch: batch_loss(recipe, network, batch))
            return optimise(recipe, quiet, on_step)


def with_quiet(recipe: Recipe, loss: Loss) -> Loss:
    """Add the recipe's quiet term, if it has one, to any loss of a batch."""
    plan = one_step(recipe)
    if plan.quiet == 0:
        return loss
    meshes = [instance.mesh for instance in DATASETS[plan.dataset]().instances]
    quiet = quiet_term(meshes, recipe.features, recipe.seed)
    return lambda network, batch: loss(network, batch) + plan.quiet * quiet(network)


def optimise(
    recipe: Recipe,
    loss_of: Loss,
    on_step: OnStep,
    initial: Callable[[Recipe], BoundedNet] = initial_network,
) -> Fit:
    """Train a recipe's network, or another that `initial` makes, against any loss of a batch."""
    plan = one_step(recipe)
    instances = DATASETS[plan.dataset]().instances
    with deterministic():
        network = initial(recipe)
        optimiser = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
            optimiser, T_max=recipe.steps, eta_min=plan.final_learning_rate
        )
        losses: list[float] = []
        for batch in _batches(recipe, plan.batch_size, instances):
            optimiser.zero_grad()
            loss = loss_of(network, batch)
            loss.backward()
            optimiser.step()
            schedule.step()
            losses.append(loss.item())
            on_step(len(losses), losses[-1])
    return Fit(network, tuple(losses))


def batch_loss(recipe: Recipe, network: BoundedNet, batch: Batch) -> Float[Tensor, ""]:
    """Refine a batch by one step of the operator and weigh its loss."""
    return step_loss(recipe, batch, paper_rule(recipe, network)(batch.points, batch.mesh))


def step_loss(recipe: Recipe, batch: Batch, step: Step) -> Float[Tensor, ""]:
    """Weigh the four loss terms of a refined batch."""
    inserted = step.points[batch.inserted]
    normals = vertex_normals(step.points, batch.children)[batch.inserted]
    return weighted_loss(
        one_step(recipe).weights,
        distance=signed_distance(batch.surface, inserted),
        normals=normals,
        surface_normals=unit_normal(batch.surface, inserted),
        ratio=step.ratio[batch.inserted],
        pairs=batch.face_pairs,
    )


def _batches(recipe: Recipe, batch_size: int, instances: Sequence[Instance]) -> Iterator[Batch]:
    """Yield one batch a step, each drawn without replacement from the whole set."""
    if batch_size >= len(instances):
        whole = disjoint_union(instances)
        for _ in range(recipe.steps):
            yield whole
        return
    rng = np.random.default_rng(recipe.seed)
    for _ in range(recipe.steps):
        drawn = rng.choice(len(instances), batch_size, replace=False)
        yield disjoint_union([instances[index] for index in drawn])


def distance_loss(distance: Float[Tensor, " I"]) -> Float[Tensor, ""]:
    """Return L_sdf: mean squared signed distance of inserted vertices to the surface."""
    return (distance**2).mean()


def normal_loss(
    normals: Float[Tensor, "I 3"], surface_normals: Float[Tensor, "I 3"]
) -> Float[Tensor, ""]:
    """Return L_n: mean of 1 − n·n*, between the refined mesh's normals and the surface's."""
    return (1 - dot(normals, surface_normals)).mean()


def fairness_loss(normals: Float[Tensor, "I 3"], pairs: Int[Tensor, "P 2"]) -> Float[Tensor, ""]:
    """Return L_fair: mean squared difference of normals over pairs of new vertices on one face."""
    first, second = normals[pairs].unbind(dim=1)
    return ((first - second) ** 2).sum(dim=-1).mean()


def proximity_loss(ratio: Float[Tensor, " I"]) -> Float[Tensor, ""]:
    """Return L_prox: mean squared proximity ratio.

    The bound itself is architectural; this term only discourages spending without gain.
    """
    return (ratio**2).mean()


def weighted_loss(
    weights: LossWeights,
    distance: Float[Tensor, " I"],
    normals: Float[Tensor, "I 3"],
    surface_normals: Float[Tensor, "I 3"],
    ratio: Float[Tensor, " I"],
    pairs: Int[Tensor, "P 2"],
) -> Float[Tensor, ""]:
    """Sum the four terms with the recipe's weights."""
    return (
        weights.distance * distance_loss(distance)
        + weights.normal * normal_loss(normals, surface_normals)
        + weights.fairness * fairness_loss(normals, pairs)
        + weights.proximity * proximity_loss(ratio)
    )


def vertex_normals(points: Float[Tensor, "V 3"], faces: Int[Tensor, "F 3"]) -> Float[Tensor, "V 3"]:
    """Return unit vertex normals, incident faces weighted by area."""
    a, b, c = (points[corner] for corner in faces.T)
    areas = torch.linalg.cross(b - a, c - a).repeat(3, 1)
    return unit(torch.zeros_like(points).index_add(0, faces.T.reshape(-1), areas))
