"""Training of a network of directed edges on stored pairs, against their surfaces."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from train.data.pair_store import make_pairs, read_pairs
from train.fitting.determinism import deterministic
from train.fitting.training_pair import Discs, TrainingPair
from train.models.directed import DirectedNet
from train.models.from_recipe import initial_directed
from train.models.recipe import DirectedForm, OnPairs, PairWeights, Recipe

# Steps in which the learning rate rises, how it falls, and its share at the end.
WARM_UP, FALL, LAST = 60, 0.7, 0.008
LONGEST_GRADIENT = 1.0

# Control meshes kept in memory.
KEPT = 1200


class PairPool:
    """Pairs to draw from: real shapes by their kinds, and procedural ones."""

    def __init__(self, files: Sequence[Path], form: DirectedForm, plan: OnPairs):
        self.plan = plan
        self.by_kind: dict[str, list[TrainingPair]] = {}
        self.kept: OrderedDict[TrainingPair, None] = OrderedDict()
        for path in files:
            pairs = read_pairs(path)
            discs = Discs(pairs)
            for number, mesh in enumerate(pairs.meshes):
                if mesh.face_count <= plan.most_faces:
                    kind, _, made_by = pairs.kinds[number].partition("/")
                    group = self.by_kind.setdefault(kind if made_by else "", [])
                    group.append(TrainingPair(discs, number, form))
        self.kinds = sorted(kind for kind in self.by_kind if kind)
        shares = np.array([plan.kinds.get(kind, 0.0) for kind in self.kinds])
        self.shares = shares / shares.sum()

    def draw(self, rng: np.random.Generator) -> TrainingPair:
        """Return a pair; those drawn the longest ago are freed."""
        kind = ""
        if rng.random() < self.plan.real or "" not in self.by_kind:
            kind = self.kinds[int(rng.choice(len(self.kinds), p=self.shares))]
        of_kind = self.by_kind[kind]
        pair = of_kind[int(rng.integers(len(of_kind)))]
        self.kept[pair] = None
        self.kept.move_to_end(pair)
        while len(self.kept) > KEPT:
            self.kept.popitem(last=False)[0].forget()
        return pair


def fit_to_pairs(
    recipe: Recipe,
    form: DirectedForm,
    plan: OnPairs,
    folders: tuple[Path, Path],
    on_step: Callable[[int, float], None],
    processes: int = 2,
) -> tuple[DirectedNet, tuple[float, ...]]:
    """Return the trained network, and the loss before each step.

    Args:
        recipe: with this form and plan.
        form, plan: its parts.
        folders: of shapes, and of the pairs, which are made where they are missing.
        on_step: called after each step with the steps done and the loss.
        processes: for making pairs.
    """
    polygons = form.base == "catmull-clark"
    count = plan.procedural
    files = make_pairs(*folders, count, recipe.seed, processes, polygons=polygons)
    with deterministic():
        network, pool = initial_directed(recipe), PairPool(files, form, plan)

        def limit_of(pair: TrainingPair) -> tuple[Tensor, Tensor]:
            made = pair.control.limit(network)
            inside = made.sharpness[pair.control.interior]
            return made.points, inside.sum() / max(len(inside), 1)

        losses = descend(recipe, plan, pool, network, limit_of, on_step)
    return network, losses


def descend(
    recipe: Recipe,
    plan: OnPairs,
    pool: PairPool,
    network: nn.Module,
    limit_of: Callable[[TrainingPair], tuple[Tensor, Tensor]],
    on_step: Callable[[int, float], None],
) -> tuple[float, ...]:
    """Train any network on drawn pairs with Adam; return the loss before each step.

    ``limit_of`` returns the points of a pair's control mesh after two levels, (M, 3), and the mean
    sharpness of its interior edges.
    """
    rng = np.random.default_rng(recipe.seed)
    optimiser = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate)
    losses: list[float] = []
    for step in range(recipe.steps):
        rate = min(1, (step + 1) / WARM_UP) * (1 - step / recipe.steps) ** FALL + LAST
        for group in optimiser.param_groups:
            group["lr"] = recipe.learning_rate * rate
        optimiser.zero_grad()
        total = 0.0
        for _ in range(plan.meshes):
            pair = pool.draw(rng)
            points, sharpness = limit_of(pair)
            loss = pair_loss(plan.weights, pair.ratios(points, rng), sharpness) / plan.meshes
            loss.backward()
            total += loss.item()
        torch.nn.utils.clip_grad_norm_(network.parameters(), LONGEST_GRADIENT)
        optimiser.step()
        losses.append(total)
        on_step(step + 1, total)
    return tuple(losses)


def pair_loss(
    weights: PairWeights, ratios: Sequence[Float[Tensor, ""]], sharpness: Float[Tensor, ""]
) -> Float[Tensor, ""]:
    """Weigh errors over the base scheme's, which grow as a logarithm beyond 1; and sharpness."""
    total = weights.sharp * sharpness
    parts = weights.mean, weights.spread, weights.peak, weights.normal
    for weight, ratio in zip(parts, ratios, strict=True):
        total = total + weight * torch.where(ratio < 1, ratio, 1 + torch.log(ratio))
    return total
