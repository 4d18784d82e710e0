"""Neural Subdivision's form: three networks on half-flaps say where vertices go, without a bound.

Source: Liu, Kim, Chaudhuri, Aigerman, Jacobson 2020, Neural Subdivision. A half-flap is a half-edge
i → j with the vertices k, l across its two faces, in a frame of its own; I makes features of the
vertices, V moves old vertices, E places new ones from the middle of their edge, each by the mean
over half-flaps. Other than in the source, lengths count in those of the half-edge, so that scale
does not matter; I makes the features anew at each level; and vertices at a boundary stay.

``python -m train.baselines.neural_subdivision SHAPES PAIRS`` trains the networks on the pairs of
the default model, by its loss, and writes them beside this file.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from sys import argv

import numpy as np
import safetensors.torch
import torch
from jaxtyping import Float
from torch import Tensor, nn

from pns_common import Scheme
from pns_common.files import replace_file
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.baselines.placement import placed_edges
from train.connectivity import Connectivity, connect, next_corner
from train.data.pair_store import make_pairs
from train.fitting.determinism import deterministic
from train.fitting.pairs_trainer import PairPool, descend
from train.fitting.training_pair import TrainingPair
from train.models.networks import perceptron
from train.models.recipe import OnPairs, Recipe
from train.tensors import dot, ratio, root, unit

WEIGHTS = Path(__file__).with_suffix(".safetensors")
# Features of a vertex, widths of the hidden layers, and coordinates of j, k and l.
FEATURES, HIDDEN, COORDINATES = 32, (32, 32), 9
# As in the source, the networks act at two levels.
LEVELS = 2
STEPS, LEARNING_RATE = 2000, 2e-3


class HalfFlapNets(nn.Module):
    """The networks I, V and E."""

    def __init__(self, generator: torch.Generator):
        super().__init__()
        read = COORDINATES + 4 * FEATURES

        def network(given: int, made: int) -> nn.Sequential:
            return perceptron((given, *HIDDEN, made), "silu", generator)

        self.start = network(COORDINATES, FEATURES)
        self.vertex, self.edge = network(read, 3 + FEATURES), network(read, 3)

    def placed(
        self, points: Float[Tensor, "V 3"], mesh: Connectivity
    ) -> tuple[Float[Tensor, "V 3"], Float[Tensor, "E 3"]]:
        """Return old vertices, and one vertex for each edge."""
        here = mesh.half_edges[mesh.paired].T.reshape(-1)
        corners, across = mesh.faces.reshape(-1), mesh.twins[here]
        ends = [here, next_corner(here), *(next_corner(next_corner(h)) for h in (here, across))]
        i, j, k, beyond = (corners[corner] for corner in ends)
        arms = torch.stack([points[to] - points[i] for to in (j, k, beyond)], dim=1)
        length = root(dot(arms[:, 0], arms[:, 0]))
        along, own = unit(arms[:, 0]), torch.linalg.cross(arms[:, 0], arms[:, 1])
        other = torch.linalg.cross(arms[:, 2], arms[:, 0])
        normal = unit(unit(own) + unit(other))
        frame = torch.stack([along, torch.linalg.cross(normal, along), normal], dim=1)
        seen = ratio(arms, length[:, None, None]) @ frame.transpose(1, 2)
        flaps = seen.reshape(len(seen), COORDINATES).float()

        def mean(values: Float[Tensor, "H K"]) -> Float[Tensor, "V K"]:
            sums = values.new_zeros(len(points), values.shape[1]).index_add(0, i, values)
            counts = torch.bincount(i, minlength=len(points)).clamp(min=1)
            return sums / counts[:, None]

        def asked(network: nn.Module, features: Float[Tensor, "V K"]) -> Float[Tensor, "H A"]:
            around = [features[at] for at in (i, j, k, beyond)]
            return network(torch.cat([flaps, *around], dim=1))

        def moved(answers: Float[Tensor, "H A"]) -> Float[Tensor, "H 3"]:
            local = (length[:, None] * answers[:, :3]).double()
            return (local[:, None] @ frame)[:, 0]

        of_vertices = asked(self.vertex, mean(self.start(flaps)))
        free = mesh.ringed[:, None]
        vertices = points + torch.where(free, mean(moved(of_vertices)), 0.0)
        pairs = moved(asked(self.edge, mean(of_vertices[:, 3:]))).reshape(2, -1, 3)
        edges = points[mesh.edges].mean(dim=1)
        paired = torch.nonzero(mesh.paired)[:, 0]
        return vertices, edges.index_add(0, paired, pairs.mean(dim=0))


def neural_subdivision(networks: HalfFlapNets | None = None) -> Scheme:
    """Return the scheme, by the networks that are kept beside this file unless others are given."""
    kept = networks or load_networks()

    def rule(level: Level) -> Additions:
        if len(level.topology.interior) == 0:
            return placed_edges(
                level,
                level.base.place(level.points, level.topology, level.blocks)[len(level.points) :],
            )
        mesh = connect(level.topology.faces, len(level.points))
        with torch.no_grad():
            vertices, edges = kept.placed(torch.tensor(level.points), mesh)
        return placed_edges(level, edges.numpy(), vertices.numpy())

    return Scheme("neural-subdivision", rule=rule, learned_levels=LEVELS)


def load_networks() -> HalfFlapNets:
    """Return the trained networks."""
    networks = HalfFlapNets(torch.Generator())
    networks.load_state_dict(safetensors.torch.load(WEIGHTS.read_bytes()))
    return networks


def fit_networks(
    recipe: Recipe, folders: tuple[Path, Path], on_step: Callable[[int, float], None]
) -> HalfFlapNets:
    """Train on the pairs of a recipe, by its loss, on the points after two levels.

    Args:
        recipe: one that trains on pairs; its steps and learning rate are these networks'.
        folders: of shapes and of pairs, as for ``train/run.py train``.
        on_step: called after each step with the steps done and the loss.
    """
    plan, form = recipe.training, recipe.directed
    assert isinstance(plan, OnPairs)
    assert form is not None
    files = make_pairs(*folders, plan.procedural, recipe.seed, 2, polygons=False)
    kept: dict[TrainingPair, list[Connectivity]] = {}

    def limit_of(pair: TrainingPair) -> tuple[Float[Tensor, "M 3"], Float[Tensor, ""]]:
        if pair not in kept:
            kept[pair] = _levels(pair)
        points = torch.from_numpy(pair.mesh.vertices.copy())
        for mesh in kept[pair]:
            points = torch.cat(networks.placed(points, mesh))
        return points, torch.zeros(())  # no sharpness

    with deterministic():
        networks = HalfFlapNets(torch.Generator().manual_seed(recipe.seed))
        descend(recipe, plan, PairPool(files, form, plan), networks, limit_of, on_step)
    return networks


def _levels(pair: TrainingPair) -> list[Connectivity]:
    """Return the meshes at which the networks act."""
    levels = [connect(np.array(pair.mesh.faces), len(pair.mesh.vertices))]
    for _ in range(LEVELS - 1):
        last = levels[-1]
        levels.append(connect(last.split().numpy(), last.vertex_count + len(last.edges)))
    return levels


def main() -> None:
    """Train the networks and write them."""
    from train.models.recipes import general

    def told(done: int, loss: float) -> None:
        if done % 100 == 0:
            print(f"{done} of {STEPS}: {loss:.3f}", flush=True)

    recipe = replace(general(), steps=STEPS, learning_rate=LEARNING_RATE)
    networks = fit_networks(recipe, (Path(argv[1]), Path(argv[2])), told)
    replace_file(WEIGHTS, safetensors.torch.save(networks.state_dict()))


if __name__ == "__main__":
    main()
