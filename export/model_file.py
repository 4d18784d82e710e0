"""Checkpoint to model file: card, graph, parity, and only then the file."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec

from export.directed_graph import directed_bytes
from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, Parity, check_directed, check_parity
from pns_common.files import replace_file
from pns_common.model.card import ModelCard
from pns_common.model.file import model_from_bytes
from train.models.checkpoint import Checkpoint
from train.models.directed import DirectedNet
from train.models.networks import BoundedNet
from train.models.torch_model import card_of


@dataclass(frozen=True, slots=True)
class Exported:
    """A model file that was written."""

    sha256: str
    parity: Parity


def export_model(checkpoint: Checkpoint, path: Path) -> Exported:
    """Write a checkpoint as a model file, in one piece.

    Raises:
        ParityError: the file would not say what the network says; nothing is written.
        ModelError: the file would break the model contract; nothing is written.
    """
    card = checkpoint_card(checkpoint)
    if isinstance(checkpoint.network, DirectedNet):
        return write_directed(checkpoint.network, card, path)
    return write_model(checkpoint.network, card, path)


def write_model(
    network: BoundedNet, card: ModelCard, path: Path, tolerance: float = TOLERANCE
) -> Exported:
    """Write a network under a card, in one piece; raises as `export_model` does."""
    data = model_bytes(network, card)
    model = model_from_bytes(data, name=path.stem)
    parity = check_parity(model, network, tolerance)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)
    return Exported(model.hash, parity)


def write_directed(network: DirectedNet, card: ModelCard, path: Path) -> Exported:
    """Write a network of directed edges under a card; raises as `export_model` does."""
    data = directed_bytes(network, card)
    model = model_from_bytes(data, name=path.stem)
    parity = check_directed(model, network)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)
    return Exported(model.hash, parity)


# What stands on a card about training, and in what order.
ORDER = (
    "recipe",
    "hidden",
    "activation",
    "dataset",
    "weights",
    "steps",
    "batch_size",
    "meshes",
    "real",
    "kinds",
    "procedural",
    "most_faces",
    "learning_rate",
    "final_learning_rate",
    "seed",
    "quiet",
    "machine",
)

# What cards call a recipe that had another name when its bundled file was made: the bytes stay.
RECORDED: Mapping[str, str] = MappingProxyType({"paper": "ridge"})


def checkpoint_card(checkpoint: Checkpoint) -> ModelCard:
    """Return the model card of a checkpoint: the whole recipe, its machine and its metrics."""
    recipe: dict[str, Any] = msgspec.to_builtins(checkpoint.recipe)
    if checkpoint.recipe.directed is not None:
        del recipe["hidden"]  # which stands with the rule
    # One level of names: how it was trained stands beside the rest.
    name = recipe.pop("name")
    facts = {"recipe": RECORDED.get(name, name), **recipe, **recipe.pop("training")}
    facts["machine"] = checkpoint.machine
    # In the order of the first models' cards, without what a recipe leaves out.
    given = {name: facts[name] for name in ORDER if facts.get(name) is not None}
    return replace(card_of(checkpoint.recipe), training=given, metrics=checkpoint.metrics)
