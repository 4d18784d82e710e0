"""Checkpoints: weights as safetensors, everything else as JSON in the same file. No pickle.

The vertex network's weights, where there is one, are named with the prefix `vertex.`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import safetensors.torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from pns_common import ModelError
from pns_common.files import replace_file
from train.models.from_recipe import initial_network, initial_vertex_network
from train.models.networks import BoundedNet
from train.models.recipe import Recipe

METADATA_KEY = "pns"
VERTEX = "vertex."


@dataclass(frozen=True, slots=True)
class Distillation:
    """Record of how networks were fitted to the answers of others.

    Attributes:
        teachers: hashes of the models whose mean answer they learned.
        meshes: pairs of the training stream on whose meshes they were asked.
        steps: Adam steps of the edge network, and of the vertex network.
    """

    teachers: tuple[str, ...]
    meshes: int
    steps: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A trained network with what it was made from and what it reached.

    Attributes:
        recipe: fixes the training.
        network: float32.
        metrics: held-out results, as on the model card.
        machine: fingerprint of the machine that trained it; elsewhere the last bits may differ.
        vertex_network: float32, where the recipe has a vertex rule.
        distilled: where the weights were fitted to answers of other models.
    """

    recipe: Recipe
    network: BoundedNet
    metrics: dict[str, Any]
    machine: str
    vertex_network: BoundedNet | None = None
    distilled: Distillation | None = None


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint in one piece: a reader sees the old file or the new one."""
    facts = {
        "recipe": checkpoint.recipe,
        "metrics": checkpoint.metrics,
        "machine": checkpoint.machine,
        "distilled": checkpoint.distilled,
    }
    data = safetensors.torch.save(
        joined_state(checkpoint.network, checkpoint.vertex_network),
        {METADATA_KEY: msgspec.json.encode(facts).decode()},
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        ModelError: there is no such file, or it is no checkpoint of ours.
    """
    if not path.is_file():
        raise ModelError(str(path), expected="a checkpoint", found="no such file")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            state = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        facts = msgspec.json.decode(metadata[METADATA_KEY], type=_Facts)
        network = initial_network(facts.recipe)
        vertex_network = initial_vertex_network(facts.recipe)
        own = {name: tensor for name, tensor in state.items() if not name.startswith(VERTEX)}
        network.load_state_dict(own)
        if vertex_network is not None:
            extra = {name.removeprefix(VERTEX): state[name] for name in state if name not in own}
            vertex_network.load_state_dict(extra)
    except (SafetensorError, KeyError, msgspec.MsgspecError, RuntimeError) as error:
        raise ModelError(
            str(path), expected="safetensors with a recipe and its weights", found=str(error)
        ) from error
    return Checkpoint(
        facts.recipe, network, facts.metrics, facts.machine, vertex_network, facts.distilled
    )


def joined_state(network: BoundedNet, vertex_network: BoundedNet | None) -> dict[str, Tensor]:
    """Return the weights of both networks under names of their own."""
    state = dict(network.state_dict())
    if vertex_network is not None:
        state |= {f"{VERTEX}{name}": w for name, w in vertex_network.state_dict().items()}
    return state


class _Facts(msgspec.Struct, forbid_unknown_fields=True):
    recipe: Recipe
    metrics: dict[str, Any]
    machine: str
    distilled: Distillation | None = None
