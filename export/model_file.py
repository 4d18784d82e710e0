"""Checkpoint to model file: card, graph, parity, and only then the file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec

from export.directed_graph import directed_bytes
from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, Parity, check_directed, check_parity, check_sharpness
from pns_common.files import replace_file
from pns_common.model.card import DEFAULT_FORMAT, DIRECTED_FORMAT, PAPER_FORMAT, ModelCard
from pns_common.model.file import model_from_bytes
from train.models.checkpoint import Checkpoint
from train.models.directed import DirectedNet
from train.models.networks import BoundedNet, SharpNet


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
    return write_model(
        checkpoint.network,
        card,
        path,
        vertex_network=checkpoint.vertex_network,
        sharpness_network=checkpoint.sharpness_network,
        face_network=checkpoint.face_network,
    )


def write_model(
    network: BoundedNet,
    card: ModelCard,
    path: Path,
    tolerance: float = TOLERANCE,
    vertex_network: BoundedNet | None = None,
    sharpness_network: SharpNet | None = None,
    face_network: BoundedNet | None = None,
) -> Exported:
    """Write networks under a card, in one piece; raises as `export_model` does."""
    data = model_bytes(network, card, vertex_network, sharpness_network, face_network)
    model = model_from_bytes(data, name=path.stem)
    parity = check_parity(model, network, tolerance, vertex_network, face_network)
    if sharpness_network is not None:
        check_sharpness(model, sharpness_network, tolerance)
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
    "faces",
    "pool",
    "reuse",
    "start",
    "learning_rate",
    "final_learning_rate",
    "seed",
    "quiet",
    "vertex",
    "sharpness",
    "face",
    "machine",
)

# What cards call a recipe that had another name when its bundled file was made: the bytes stay.
RECORDED: Mapping[str, str] = MappingProxyType({"paper": "ridge"})


def checkpoint_card(checkpoint: Checkpoint) -> ModelCard:
    """Return the model card of a checkpoint: the whole recipe, its machine and its metrics."""
    recipe: dict[str, Any] = msgspec.to_builtins(checkpoint.recipe)
    on_card = {
        name: recipe.pop(name) for name in ("features", "gate_sharpness", "budget", "orientation")
    }
    vertex, form = checkpoint.recipe.vertex, checkpoint.recipe.scale_free
    directed, version = checkpoint.recipe.directed, PAPER_FORMAT if form is None else DEFAULT_FORMAT
    if directed is not None:
        version, own = DIRECTED_FORMAT, recipe.pop("directed")
        # What the rule says stands once.
        on_card |= own | {"boundary_strength": own.pop("curve_strength")}
        recipe["hidden"] = on_card.pop("hidden")
    if vertex is not None:
        on_card["vertex_features"] = recipe["vertex"].pop("features")
        on_card["vertex_gate_sharpness"] = recipe["vertex"].pop("gate_sharpness")
    for name in ("sharpness", "face"):
        if recipe[name] is not None:
            on_card[f"{name}_features"] = recipe[name].pop("features")
            recipe[name] = {key: what for key, what in recipe[name].items() if what is not None}
    if form is not None:
        on_card |= recipe.pop("scale_free")
    # One level of names: how it was trained stands beside the rest.
    name = recipe.pop("name")
    facts = {"recipe": RECORDED.get(name, name), **recipe, **recipe.pop("training")}
    facts["machine"] = checkpoint.machine
    # In the order of the first models' cards, without what a recipe leaves out.
    given = {name: facts[name] for name in ORDER if facts.get(name) is not None}
    return ModelCard(
        format=version,
        training=given,
        metrics=checkpoint.metrics,
        **on_card,
    )
