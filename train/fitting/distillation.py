"""Networks fitted to what other models answer, in the mean.

A network that learns another's answers, and not the shapes behind them, comes near to what it says
(Bucilă, Caruana and Niculescu-Mizil 2006; Hinton, Vinyals and Dean 2015): so a rule gets a smaller
network or another activation, which takes less time, and keeps what it was chosen for. Of several
teachers it learns the mean answer, which errs less than each.

Teachers are asked at level 0, on the coarse meshes of the training stream, on what Loop makes of
some of them, which has the small bends of fine meshes, and on regular ones: these have few rows
each, and an error there shows as a shape that is less round. A row counts by the square of its
gate, since the operator adds gate times answer.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from pns_common import Mesh, ParameterError, load_model, loop, pns, refine
from pns_common.model.card import ModelCard
from pns_common.model.session import Model
from train.data.pairs.pair_stream import pair_stream
from train.data.primitives import box, globe, icosphere, tetrahedron, torus
from train.fitting.determinism import deterministic
from train.models.checkpoint import Distillation, load_checkpoint
from train.models.from_recipe import initial_network, initial_vertex_network
from train.models.networks import BoundedNet
from train.models.recipe import Recipe
from train.models.torch_model import recipe_model

# Rows of a mesh that are kept, of each network; those of a regular one are repeated to so many.
MOST_ROWS, REGULAR_ROWS = 1000, 20_000
# How often a mesh's refinement is asked about as well, and how often that is shaken before.
REFINED, SHAKEN = 0.5, 0.5
SHAKES = (1e-4, 1e-2)
LARGEST_REFINED = 1500
# Rows of a step, its learning rate at most, and the share of the steps in which it rises.
BATCH_ROWS, LEARNING_RATE, WARM_UP = 8192, 4e-3, 0.03


@dataclass(frozen=True, eq=False)
class Answers:
    """Rows of features, and the mean answer to each at budget 1."""

    features: Float32[np.ndarray, "N K"]
    answers: Float32[np.ndarray, "N 3"]


@dataclass(frozen=True, eq=False)
class Mean:
    """The mean of several models as one, which keeps what it was asked and what it answered."""

    teachers: Sequence[Model]
    heard: dict[str, list[Answers]] = field(default_factory=lambda: {"edges": [], "vertices": []})
    name: str = "mean"
    hash: str = ""

    @property
    def card(self) -> ModelCard:
        """The first one's."""
        return self.teachers[0].card

    def __call__(
        self, features: Float[np.ndarray, "N K"], budget: float
    ) -> Float32[np.ndarray, "N 3"]:
        """Answer for edges."""
        return self._keep("edges", features, [each(features, budget) for each in self.teachers])

    def vertex_correction(
        self, features: Float[np.ndarray, "N L"], budget: float
    ) -> Float32[np.ndarray, "N 3"]:
        """Answer for old vertices."""
        said = [each.vertex_correction(features, budget) for each in self.teachers]
        return self._keep("vertices", features, said)

    def _keep(
        self,
        where: str,
        features: Float[np.ndarray, "N K"],
        said: Sequence[Float[np.ndarray, "N 3"]],
    ) -> Float32[np.ndarray, "N 3"]:
        mean = np.stack(said).mean(axis=0, dtype=np.float64).astype(np.float32)
        self.heard[where].append(Answers(features.astype(np.float32), mean))
        return mean


def load_teacher(path: Path) -> Model:
    """Load a model file, or a checkpoint where the name ends in .safetensors. Raises ModelError."""
    if path.suffix != ".safetensors":
        return load_model(path)
    checkpoint = load_checkpoint(path)
    return recipe_model(checkpoint.recipe, checkpoint.network, checkpoint.vertex_network)


def planned(recipe: Recipe, teachers: Sequence[Model], meshes: int, steps: int) -> Distillation:
    """Return how a recipe's networks are to be fitted to teachers.

    Raises:
        ParameterError: the recipe is not scale-free, a teacher reads other features, or two
            teachers are the same.
    """
    if recipe.scale_free is None or recipe.vertex is None:
        raise ParameterError("recipe", recipe.name, expected="a scale-free one")
    wanted = recipe.features, recipe.vertex.features
    for teacher in teachers:
        read = teacher.card.features, teacher.card.vertex_features
        if read != wanted:
            expected = f"a model that reads {' and '.join(wanted)}"
            raise ParameterError("teacher", teacher.name, expected=expected)
    hashes = tuple(teacher.hash for teacher in teachers)
    if len(set(hashes)) < len(hashes):
        raise ParameterError("teachers", hashes, expected="different ones")
    return Distillation(hashes, meshes, (steps, steps))


def distil(
    recipe: Recipe,
    teachers: Sequence[Model],
    plan: Distillation,
    on_step: Callable[[int, float], None],
) -> tuple[BoundedNet, BoundedNet]:
    """Return networks of a recipe that answer what all teachers do in the mean.

    Args:
        on_step: called after each step of either network, with the number of steps and the loss.
    """
    network, vertex_network, rule = (
        initial_network(recipe),
        initial_vertex_network(recipe),
        recipe.vertex,
    )
    assert vertex_network is not None  # ``planned`` refuses it
    assert rule is not None
    with deterministic():
        heard = asked(teachers, coarse_and_fine(recipe.seed, plan.meshes), recipe.seed)
        of_regular = asked(teachers, regular_meshes(), recipe.seed, REGULAR_ROWS)
        edges, vertices = (joined(both) for both in zip(heard, of_regular, strict=True))
        fitted = (
            (network, edges, lambda x: torch.tanh(recipe.gate_sharpness * x**2)),
            (vertex_network, vertices, lambda x: torch.tanh(rule.gate_sharpness * x)),
        )
        done = 0
        for (student, answers, gate), steps in zip(fitted, plan.steps, strict=True):
            for loss in _steps(student, answers, gate, steps, recipe.seed):
                done += 1
                on_step(done, loss)
    return network, vertex_network


def asked(
    teachers: Sequence[Model], meshes: Iterable[Mesh], seed: int, repeated: int = 0
) -> tuple[Answers, Answers]:
    """Return what all answer in the mean on some meshes, at edges and at vertices.

    ``repeated``: to how many rows those of a mesh are repeated, if they are fewer.
    """
    rng = np.random.default_rng(seed)
    mean = Mean(teachers)
    kept: dict[str, list[Answers]] = {where: [] for where in mean.heard}
    for mesh in meshes:
        # In training no edge is a crease. One thread keeps the order of rows, which are drawn from.
        refine(mesh, pns(mean), 1, creases=None, threads=1)
        for where, heard in mean.heard.items():
            together = joined(heard) if heard else None
            # Where no gate is open nothing is asked.
            if together is not None and len(together.features):
                rows = rng.permutation(len(together.features))[:MOST_ROWS]
                rows = np.resize(rows, max(len(rows), repeated))
                kept[where].append(Answers(together.features[rows], together.answers[rows]))
            heard.clear()
    return joined(kept["edges"]), joined(kept["vertices"])


def joined(parts: Sequence[Answers]) -> Answers:
    """Return all rows as one."""
    return Answers(
        np.concatenate([part.features for part in parts]),
        np.concatenate([part.answers for part in parts]),
    )


def coarse_and_fine(seed: int, count: int) -> Iterator[Mesh]:
    """Yield the coarse meshes of so many pairs, and after some of them what Loop makes of them."""
    rng = np.random.default_rng(seed)
    for pair in islice(pair_stream(seed), count):
        yield pair.coarse
        if len(pair.coarse.faces) <= LARGEST_REFINED and rng.random() < REFINED:
            fine = refine(pair.coarse, loop(), 1, threads=1).mesh
            shake = rng.uniform(*SHAKES) if rng.random() < SHAKEN else 0.0
            points = fine.vertices + shake * rng.standard_normal(fine.vertices.shape)
            yield Mesh(points, fine.faces)


def regular_meshes() -> Iterator[Mesh]:
    """Yield spheres of many resolutions, tori and a box."""
    yield tetrahedron()
    yield box()
    yield from (icosphere(splits) for splits in range(5))
    yield from (globe(sides, sides // 2 - 1) for sides in (4, 6, 8, 12, 16, 24, 48))
    yield from (torus(around, around // 2) for around in (12, 24, 48))


def _steps(
    network: BoundedNet, answers: Answers, gate: Callable[[Tensor], Tensor], steps: int, seed: int
) -> Iterator[float]:
    """Take Adam steps towards the answers, in gated squares; yield the loss before each.

    The first feature of either network is what its gate reads.
    """
    features, wanted = torch.from_numpy(answers.features), torch.from_numpy(answers.answers)
    generator = torch.Generator().manual_seed(seed)
    optimiser = torch.optim.Adam(network.parameters(), LEARNING_RATE, betas=(0.9, 0.99))
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, total_steps=steps, pct_start=WARM_UP, cycle_momentum=False
    )
    for _ in range(steps):
        rows = torch.randint(len(features), (BATCH_ROWS,), generator=generator)
        weight = gate(features[rows, 0]).square()
        square = (network(features[rows], 1.0) - wanted[rows]).square().sum(dim=1)
        loss = (weight * square).sum() / weight.sum()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        yield loss.item()
