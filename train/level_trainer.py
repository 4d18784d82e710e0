"""Training through levels: the operator and its vertex rule, on the stream of random surfaces."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import torch

from pns_common.edge_operator import EdgeOperator
from pns_common.vertex_operator import VertexOperator
from train.determinism import deterministic
from train.level_loss import references, rollout_loss
from train.networks import BoundedNet
from train.recipe_operator import (
    initial_network,
    initial_vertex_network,
    recipe_operator,
    vertex_rule_operator,
)
from train.recipes import LevelWeights, Polish, Recipe, StreamTraining
from train.rollout import level_batch, rollout
from train.star_term import StarTerm
from train.stream import stream

WARM_UP = 0.1
"""Share of the steps in which the learning rate rises."""

LONGEST_GRADIENT = 1.0


def depth(plan: StreamTraining, batch_size: int, step: int) -> tuple[tuple[LevelWeights, ...], int]:
    """Return the levels of a training step, and how many instances it takes through them."""
    if step % plan.deepest_every:
        return plan.levels[:-1], batch_size
    return plan.levels, max(1, batch_size // 4)


@dataclass(frozen=True, eq=False)
class Learner:
    """What is trained, and the rules that it makes up."""

    network: BoundedNet
    vertex_network: BoundedNet | None
    operator: EdgeOperator
    vertex_operator: VertexOperator | None

    @property
    def weights(self) -> list[torch.nn.Parameter]:
        """All that training may change."""
        networks = [one for one in (self.network, self.vertex_network) if one is not None]
        return [weight for network in networks for weight in network.parameters()]


def fit_through_levels(
    recipe: Recipe, on_step: Callable[[int, float], None]
) -> tuple[BoundedNet, BoundedNet | None, tuple[float, ...]]:
    """Return the trained networks of a recipe with `stream`, and the loss before each step."""
    assert recipe.stream is not None
    device = "cuda" if torch.cuda.is_available() else "cpu"
    rounds = [Polish(recipe.stream, recipe.steps, recipe.learning_rate)]
    if recipe.polish is not None:
        rounds.append(recipe.polish)
    with deterministic():
        learner = _learner(recipe, device)
        losses: list[float] = []
        for number, one in enumerate(rounds):
            for loss in _train(learner, recipe, one, recipe.seed + number, device):
                losses.append(loss)
                on_step(len(losses), loss)
    network, vertex_network = learner.network, learner.vertex_network
    return network.cpu(), None if vertex_network is None else vertex_network.cpu(), tuple(losses)


def _learner(recipe: Recipe, device: str) -> Learner:
    network, vertex_network = initial_network(recipe).to(device), initial_vertex_network(recipe)
    operator = recipe_operator(recipe, network)
    if recipe.vertex is None or vertex_network is None:
        return Learner(network, None, operator, None)
    vertex_network = vertex_network.to(device)
    vertices = vertex_rule_operator(recipe.vertex, vertex_network)
    return Learner(network, vertex_network, operator, vertices)


def _train(
    learner: Learner, recipe: Recipe, one: Polish, seed: int, device: str
) -> Iterator[float]:
    """Train for one round; yield the loss before each step."""
    plan, budget = one.stream, recipe.budget
    optimiser = torch.optim.Adam(learner.weights, lr=one.learning_rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, one.learning_rate, total_steps=one.steps, pct_start=WARM_UP
    )
    star_term = StarTerm(seed, plan.star_margin, plan.star_shares, device)
    instances = stream(seed)
    for step in range(one.steps):
        levels, size = depth(plan, recipe.batch_size, step)
        batch = level_batch(list(islice(instances, size)), len(levels), device)
        points = rollout(batch, learner.operator, budget, learner.vertex_operator)
        loss = rollout_loss(levels, batch, points, references(batch))
        if plan.star > 0 and step % plan.star_every == 0:
            short = star_term(learner.operator, budget, learner.vertex_operator)
            loss = loss + plan.star * short.to(loss)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(learner.weights, LONGEST_GRADIENT)
        optimiser.step()
        schedule.step()
        yield loss.item()
