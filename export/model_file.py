"""Checkpoint to model file: card, graph, parity, and only then the file."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, Parity, check_parity
from pns_common.model_card import FORMAT, VERTEX_FORMAT, ModelCard
from pns_common.onnx_model import model_from_bytes
from train.checkpoint import Checkpoint
from train.networks import BoundedNet


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written."""

    sha256: str
    parity: Parity


def export_model(checkpoint: Checkpoint, path: Path) -> Exported:
    """Write a checkpoint as a model file, in one piece.

    Raises:
        ParityError: the file would not say what the network says; nothing is written.
        ModelError: the file would break the model contract; nothing is written.
    """
    return write_model(
        checkpoint.network,
        checkpoint_card(checkpoint),
        path,
        vertex_network=checkpoint.vertex_network,
    )


def write_model(
    network: BoundedNet,
    card: ModelCard,
    path: Path,
    tolerance: float = TOLERANCE,
    vertex_network: BoundedNet | None = None,
) -> Exported:
    """Write a network, or two, under a card, in one piece; raises as `export_model` does."""
    data = model_bytes(network, card, vertex_network)
    model = model_from_bytes(data, name=path.stem)
    parity = check_parity(model, network, tolerance, vertex_network)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_bytes(data)
    temporary.replace(path)
    return Exported(model.hash, parity)


def checkpoint_card(checkpoint: Checkpoint) -> ModelCard:
    """Return the model card of a checkpoint: the whole recipe, its machine and its metrics."""
    recipe: dict[str, Any] = asdict(checkpoint.recipe)
    on_card = {
        name: recipe.pop(name) for name in ("features", "gate_sharpness", "budget", "orientation")
    }
    vertex = checkpoint.recipe.vertex
    if vertex is not None:
        on_card["vertex_features"] = recipe["vertex"].pop("features")
        on_card["vertex_gate_sharpness"] = recipe["vertex"].pop("gate_sharpness")
    # What a recipe leaves out its card does not mention.
    given = {name: value for name, value in recipe.items() if value is not None}
    training = {"recipe": given.pop("name"), **given, "machine": checkpoint.machine}
    return ModelCard(
        format=FORMAT if vertex is None else VERTEX_FORMAT,
        training=training,
        metrics=checkpoint.metrics,
        **on_card,
    )
