"""Checkpoints: weights as safetensors, everything else as JSON in the same file. No pickle."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import safetensors.torch
from safetensors import SafetensorError, safe_open

from pns_common import ModelError
from pns_common.files import replace_file
from train.models.directed import DirectedNet
from train.models.from_recipe import initial_directed, initial_network
from train.models.networks import BoundedNet
from train.models.recipe import Recipe

METADATA_KEY = "pns"


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A trained network with what it was made from and what it reached.

    Attributes:
        recipe: fixes the training.
        network: float32; of directed edges where the recipe is.
        metrics: held-out results, as on the model card.
        machine: fingerprint of the machine that trained it; elsewhere the last bits may differ.
    """

    recipe: Recipe
    network: BoundedNet | DirectedNet
    metrics: dict[str, Any]
    machine: str


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint in one piece: a reader sees the old file or the new one."""
    facts = {
        "recipe": checkpoint.recipe,
        "metrics": checkpoint.metrics,
        "machine": checkpoint.machine,
    }
    data = safetensors.torch.save(
        checkpoint.network.state_dict(),
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
        made = initial_network if facts.recipe.directed is None else initial_directed
        network = made(facts.recipe)
        network.load_state_dict(state)
    except (SafetensorError, KeyError, msgspec.MsgspecError, RuntimeError) as error:
        raise ModelError(
            str(path), expected="safetensors with a recipe and its weights", found=str(error)
        ) from error
    return Checkpoint(facts.recipe, network, facts.metrics, facts.machine)


class _Facts(msgspec.Struct, forbid_unknown_fields=True):
    recipe: Recipe
    metrics: dict[str, Any]
    machine: str
