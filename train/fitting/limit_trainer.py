"""Training on the limit surface after one learned level, on a stream of coarse meshes."""

import multiprocessing
import pickle
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from train.data.pairs.pair_stream import pair_stream
from train.data.pairs.polygons import polygon_stream
from train.data.pairs.references import Pair
from train.fitting.determinism import deterministic
from train.fitting.limit_batch import LimitBatch, limit_batch
from train.fitting.limit_loss import LimitMeasures, limit_loss, measure, sharpness_loss
from train.models.from_recipe import initial_networks
from train.models.networks import Networks
from train.models.recipe import Recipe, ToLimit

# Share of the steps in which the learning rate rises.
WARM_UP = 0.1

LONGEST_GRADIENT = 1.0


def fit_to_limit(
    recipe: Recipe, plan: ToLimit, on_step: Callable[[int, float], None]
) -> tuple[Networks, tuple[float, ...]]:
    """Return the trained networks of a scale-free recipe, and the loss before each step.

    Sharpness alone is trained first, against the truth; then all networks on the limit.
    """
    with deterministic():
        networks = initial_networks(recipe)
        weights = [each for each in networks.parameters() if each.requires_grad]
        optimiser = torch.optim.Adam(weights, lr=recipe.learning_rate)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, recipe.learning_rate, total_steps=recipe.steps, pct_start=WARM_UP
        )
        losses: list[float] = []
        for batch, reference in batches(recipe, plan):
            logits = batch.level.logits(networks.sharp)
            loss = plan.weights.sharp * sharpness_loss(batch, logits)
            if len(losses) >= plan.start:
                loss = loss + limit_loss(
                    plan.weights, limit_measures(batch, networks, logits), reference
                )
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(weights, LONGEST_GRADIENT)
            optimiser.step()
            schedule.step()
            losses.append(loss.item())
            on_step(len(losses), losses[-1])
    return networks, tuple(losses)


def limit_measures(
    batch: LimitBatch, networks: Networks, logits: Float[Tensor, " I"]
) -> LimitMeasures:
    """Take the learned level, the next one, and measure the limit of the base scheme after them."""
    sharp = batch.level.sharpness(logits)
    return measure(batch, batch.level.second(sharp, batch.level.first(sharp, networks)))


def reference_of(batch: LimitBatch) -> LimitMeasures:
    """Return the base scheme's measures on a batch."""
    with torch.no_grad():
        smooth = batch.level.smooth_sharpness()
        return measure(batch, batch.level.second(smooth, batch.level.first(smooth, None)))


def batches(recipe: Recipe, plan: ToLimit) -> Iterator[tuple[LimitBatch, LimitMeasures]]:
    """Yield one batch a step, drawn from a pool that grows until its oldest give way to new ones.

    Making a batch takes as long as some ten steps on it, so another process makes the next one.
    """
    pool: list[tuple[LimitBatch, LimitMeasures]] = []
    # A process takes as long to start as a batch: one batch is made here.
    several = recipe.steps > plan.reuse
    for draw in ahead(_draws, recipe, plan) if several else _draws(recipe, plan):
        pool = [*pool, (draw.batch, draw.reference)][-plan.pool :]
        for place in draw.places:
            yield pool[place]


@dataclass(frozen=True, eq=False)
class _Draw:
    """A new batch of a pool, and the places in the pool that the steps after it take."""

    batch: LimitBatch
    reference: LimitMeasures
    places: list[int]


def _draws(recipe: Recipe, plan: ToLimit) -> Iterator[_Draw]:
    rng = np.random.default_rng(recipe.seed)
    with deterministic():
        fresh = _fresh(recipe, plan, rng)
        for number, first in enumerate(range(0, recipe.steps, plan.reuse), start=1):
            batch, reference = next(fresh)
            steps = min(plan.reuse, recipe.steps - first)
            places = rng.integers(min(number, plan.pool), size=steps)
            yield _Draw(batch, reference, places.tolist())


def _fresh(
    recipe: Recipe, plan: ToLimit, rng: np.random.Generator
) -> Iterator[tuple[LimitBatch, LimitMeasures]]:
    waiting: list[Pair] = []
    pairs = pair_stream if recipe.face is None else polygon_stream
    for pair in pairs(recipe.seed):
        waiting.append(pair)
        if sum(mesh_pair.coarse.face_count for mesh_pair in waiting) >= plan.faces:
            batch = limit_batch(waiting, recipe, rng)
            waiting = []
            yield batch, reference_of(batch)


T = TypeVar("T")


def ahead(make: Callable[..., Iterator[T]], *arguments: object) -> Iterator[T]:
    """Yield what ``make(*arguments)`` yields: the next value is made while one is worked on.

    `make` is a function that a fresh process can import, the arguments and values can be pickled.
    What it raises is raised here.

    Raises:
        EOFError: the process was ended from outside.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_send_all, args=(there, make, arguments), daemon=True)
    process.start()
    there.close()
    try:
        while (message := pickle.loads(here.recv_bytes())) is not None:
            value, error = message
            if error is not None:
                raise error
            yield value
    finally:
        here.close()
        process.terminate()
        process.join()


def _send_all(
    there: Connection, make: Callable[..., Iterator[object]], arguments: tuple[object, ...]
) -> None:
    # Whoever interrupts the work means the process that does it, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        for value in make(*arguments):
            # Waits here, one value ahead. Bytes: tensors would be sent as open files, one each.
            there.send_bytes(pickle.dumps((value, None)))
        there.send_bytes(pickle.dumps(None))
    except Exception as error:
        there.send_bytes(pickle.dumps((None, error)))
