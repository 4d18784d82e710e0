"""Checkpoint to model file: card, graph, parity, and only then the file."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, Parity, check_parity
from pns_common.model_card import FORMAT, ModelCard
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
    return write_model(checkpoint.network, checkpoint_card(checkpoint), path)


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
    training = {"recipe": recipe.pop("name"), **recipe, "machine": checkpoint.machine}
    return ModelCard(
        format=FORMAT,
        training=training,
        metrics=checkpoint.metrics,
        **on_card,
    )
