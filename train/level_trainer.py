"""Training through levels: the operator and its vertex rule, on the stream of random surfaces."""

from collections.abc import Callable

import numpy as np
import torch

from train.determinism import deterministic
from train.level_loss import references, rollout_loss
from train.networks import BoundedNet
from train.recipe_operator import (
    initial_network,
    initial_vertex_network,
    recipe_operator,
    vertex_rule_operator,
)
from train.recipes import LevelWeights, Recipe, StreamTraining
from train.rollout import level_batch, rollout
from train.star_term import StarTerm
from train.stream import random_instance

WARM_UP = 0.1
"""Share of the steps in which the learning rate rises."""

LONGEST_GRADIENT = 1.0


def depth(plan: StreamTraining, batch_size: int, step: int) -> tuple[tuple[LevelWeights, ...], int]:
    """Return the levels of a training step, and how many instances it takes through them."""
    if step % plan.deepest_every:
        return plan.levels[:-1], batch_size
    return plan.levels, max(1, batch_size // 4)


def fit_through_levels(
    recipe: Recipe, on_step: Callable[[int, float], None]
) -> tuple[BoundedNet, BoundedNet | None, tuple[float, ...]]:
    """Return the trained networks of a recipe with `stream`, and the loss before each step."""
    plan = recipe.stream
    assert plan is not None
    device = "cuda" if torch.cuda.is_available() else "cpu"
    with deterministic():
        network, vertex_network = initial_network(recipe), initial_vertex_network(recipe)
        both = [one.to(device) for one in (network, vertex_network) if one is not None]
        parameters = [weight for one in both for weight in one.parameters()]
        optimiser = torch.optim.Adam(parameters, lr=recipe.learning_rate)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, recipe.learning_rate, total_steps=recipe.steps, pct_start=WARM_UP
        )
        operator = recipe_operator(recipe, network)
        vertex_operator = (
            None
            if recipe.vertex is None or vertex_network is None
            else vertex_rule_operator(recipe.vertex, vertex_network)
        )
        star_term = StarTerm(recipe.seed, plan.star_margin, device)
        rng = np.random.default_rng(recipe.seed)
        losses: list[float] = []
        for step in range(recipe.steps):
            levels, size = depth(plan, recipe.batch_size, step)
            batch = level_batch([random_instance(rng) for _ in range(size)], len(levels), device)
            points = rollout(batch, operator, recipe.budget, vertex_operator)
            loss = rollout_loss(levels, batch, points, references(batch))
            if plan.star > 0 and step % plan.star_every == 0:
                short = star_term(operator, recipe.budget, vertex_operator)
                loss = loss + plan.star * short.to(loss)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(parameters, LONGEST_GRADIENT)
            optimiser.step()
            schedule.step()
            losses.append(loss.item())
            on_step(len(losses), losses[-1])
    return network.cpu(), None if vertex_network is None else vertex_network.cpu(), tuple(losses)
