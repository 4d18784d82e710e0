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

from train.data.pairs.pair_stream import pair_stream
from train.data.pairs.references import Pair
from train.fitting.determinism import deterministic
from train.fitting.limit_batch import LimitBatch, limit_batch
from train.fitting.limit_loss import LimitMeasures, Standards, limit_loss, measure
from train.models.from_recipe import initial_network, initial_vertex_network
from train.models.networks import BoundedNet
from train.models.recipe import Recipe, ToLimit, scale_free_parts

# Share of the steps in which the learning rate rises.
WARM_UP = 0.1

LONGEST_GRADIENT = 1.0


def fit_to_limit(
    recipe: Recipe, plan: ToLimit, on_step: Callable[[int, float], None]
) -> tuple[BoundedNet, BoundedNet, tuple[float, ...]]:
    """Return the trained networks of a scale-free recipe, and the loss before each step."""
    with deterministic():
        network, vertex_network = initial_network(recipe), initial_vertex_network(recipe)
        scale_free_parts(recipe)
        assert vertex_network is not None  # a scale-free recipe has one
        weights = [*network.parameters(), *vertex_network.parameters()]
        optimiser = torch.optim.Adam(weights, lr=recipe.learning_rate)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, recipe.learning_rate, total_steps=recipe.steps, pct_start=WARM_UP
        )
        losses: list[float] = []
        for batch, standards in _batches(recipe, plan):
            measures = limit_measures(batch, network, vertex_network)
            loss = limit_loss(plan.weights, batch, measures, standards)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(weights, LONGEST_GRADIENT)
            optimiser.step()
            schedule.step()
            losses.append(loss.item())
            on_step(len(losses), losses[-1])
    return network, vertex_network, tuple(losses)


def limit_measures(
    batch: LimitBatch, network: BoundedNet, vertex_network: BoundedNet
) -> LimitMeasures:
    """Take the learned level, and measure the limit of Loop after it."""
    return measure(batch, batch.level.points(network, vertex_network))


def standards_of(batch: LimitBatch) -> Standards:
    """Return Loop's measures on a batch, and those of quasi-interpolation along the normal."""
    with torch.no_grad():
        return Standards(measure(batch, batch.level.base), measure(batch, batch.level.pushed))


def _batches(recipe: Recipe, plan: ToLimit) -> Iterator[tuple[LimitBatch, Standards]]:
    """Yield one batch a step, drawn from a pool that grows until its oldest give way to new ones.

    Making a batch takes as long as some ten steps on it, so another process makes the next one.
    """
    pool: list[tuple[LimitBatch, Standards]] = []
    # A process takes as long to start as a batch: one batch is made here.
    several = recipe.steps > plan.reuse
    for draw in ahead(_draws, recipe, plan) if several else _draws(recipe, plan):
        pool = [*pool, (draw.batch, draw.standards)][-plan.pool :]
        for place in draw.places:
            yield pool[place]


@dataclass(frozen=True, eq=False)
class _Draw:
    """A new batch of a pool, and the places in the pool that the steps after it take."""

    batch: LimitBatch
    standards: Standards
    places: list[int]


def _draws(recipe: Recipe, plan: ToLimit) -> Iterator[_Draw]:
    rng = np.random.default_rng(recipe.seed)
    with deterministic():
        fresh = _fresh(recipe, plan, rng)
        for number, first in enumerate(range(0, recipe.steps, plan.reuse), start=1):
            batch, standards = next(fresh)
            steps = min(plan.reuse, recipe.steps - first)
            places = rng.integers(min(number, plan.pool), size=steps)
            yield _Draw(batch, standards, places.tolist())


def _fresh(
    recipe: Recipe, plan: ToLimit, rng: np.random.Generator
) -> Iterator[tuple[LimitBatch, Standards]]:
    waiting: list[Pair] = []
    for pair in pair_stream(recipe.seed):
        waiting.append(pair)
        if sum(len(mesh_pair.coarse.faces) for mesh_pair in waiting) >= plan.faces:
            batch = limit_batch(waiting, recipe, rng)
            waiting = []
            yield batch, standards_of(batch)


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
