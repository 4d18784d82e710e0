"""Checkpoints: weights as safetensors, everything else as JSON in the same file. No pickle.

The weights of the vertex, sharpness and face networks, where there are, are named with the prefixes
`vertex.`, `sharpness.` and `face.`.
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
from train.models.directed import DirectedNet
from train.models.from_recipe import (
    initial_directed,
    initial_face_network,
    initial_network,
    initial_sharpness_network,
    initial_vertex_network,
)
from train.models.networks import BoundedNet, SharpNet
from train.models.recipe import Recipe

METADATA_KEY = "pns"
PREFIXES = ("vertex.", "sharpness.", "face.")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A trained network with what it was made from and what it reached.

    Attributes:
        recipe: fixes the training.
        network: float32; of directed edges where the recipe is.
        metrics: held-out results, as on the model card.
        machine: fingerprint of the machine that trained it; elsewhere the last bits may differ.
        vertex_network: float32, where the recipe has a vertex rule.
        sharpness_network, face_network: float32, where the recipe has them.
    """

    recipe: Recipe
    network: BoundedNet | DirectedNet
    metrics: dict[str, Any]
    machine: str
    vertex_network: BoundedNet | None = None
    sharpness_network: SharpNet | None = None
    face_network: BoundedNet | None = None

    @property
    def extra(self) -> tuple[BoundedNet | None, SharpNet | None, BoundedNet | None]:
        """The networks beside that of edges, in the order of the prefixes."""
        return self.vertex_network, self.sharpness_network, self.face_network


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint in one piece: a reader sees the old file or the new one."""
    facts = {
        "recipe": checkpoint.recipe,
        "metrics": checkpoint.metrics,
        "machine": checkpoint.machine,
    }
    data = safetensors.torch.save(
        joined_state(checkpoint.network, *checkpoint.extra),
        {METADATA_KEY: msgspec.json.encode(facts).decode()},
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint; a sharpness network that is another model's is taken from that one now.

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
        vertex = initial_vertex_network(facts.recipe)
        sharpness = initial_sharpness_network(facts.recipe)
        face = initial_face_network(facts.recipe)
        for prefix, part in zip(PREFIXES, (vertex, sharpness, face), strict=True):
            if part is not None:
                names = [name for name in state if name.startswith(prefix)]
                own = {n.removeprefix(prefix): state.pop(n) for n in names}
                if any(weight.requires_grad for weight in part.parameters()):
                    part.load_state_dict(own)
        network.load_state_dict(state)
    except (SafetensorError, KeyError, msgspec.MsgspecError, RuntimeError) as error:
        raise ModelError(
            str(path), expected="safetensors with a recipe and its weights", found=str(error)
        ) from error
    return Checkpoint(facts.recipe, network, facts.metrics, facts.machine, vertex, sharpness, face)


def joined_state(
    network: BoundedNet | DirectedNet,
    vertex_network: BoundedNet | None,
    sharpness_network: SharpNet | None,
    face_network: BoundedNet | None = None,
) -> dict[str, Tensor]:
    """Return the weights of all networks under names of their own."""
    state = dict(network.state_dict())
    extra = vertex_network, sharpness_network, face_network
    for prefix, part in zip(PREFIXES, extra, strict=True):
        if part is not None:
            state |= {f"{prefix}{name}": w for name, w in part.state_dict().items()}
    return state


class _Facts(msgspec.Struct, forbid_unknown_fields=True):
    recipe: Recipe
    metrics: dict[str, Any]
    machine: str
