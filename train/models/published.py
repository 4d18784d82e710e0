"""The author's published networks, read as data: no pickled code is ever run.

Two layouts are understood: one `weights.npz` with arrays `CHECKPOINT/net.LAYER.weight|bias`, or a
clone of https://github.com/ugail/Proximity-Preserving-Neural-Subdivision with its `.pt` files.
Layout and settings of the weights (GELU, c = 10) are facts of that repository.
"""

import pickle
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from pns_common import ModelError
from train.models.networks import BoundedNet

ACTIVATION = "gelu"
GATE_SHARPNESS = 10.0

DEFAULT_BUDGET = 0.5

State = Mapping[str, Tensor]


def is_operator(checkpoint: str) -> bool:
    """Return whether a checkpoint's network is PNS itself, not ablated, not unconstrained."""
    return checkpoint.startswith("pns_") or checkpoint == "ablation_PNS_full_trained"


def published_budget(checkpoint: str) -> float:
    """Return the C of a checkpoint, which its name tells where it is not 0.5."""
    match = re.search(r"_C(\d+(?:\.\d+)?)", checkpoint)
    return float(match.group(1)) if match else DEFAULT_BUDGET


def load_published(folder: Path) -> dict[str, BoundedNet]:
    """Return every network of a folder by its checkpoint's name, as float32.

    Raises:
        ModelError: there is no such folder or no checkpoint in it, or one is not what it should be.
    """
    archive = folder / "weights.npz"
    states = _from_archive(archive) if archive.is_file() else _from_clone(folder)
    if not states:
        raise ModelError(str(folder), expected="weights.npz or .pt files", found="neither")
    return {name: network_from_state(name, state) for name, state in sorted(states.items())}


def network_from_state(name: str, state: State) -> BoundedNet:
    """Return the network of a state dictionary `net.0.weight`, `net.0.bias`, `net.2.weight`, ….

    Raises:
        ModelError: other keys or shapes.
    """
    weights = [key for key in state if key.endswith(".weight")]
    try:
        shapes = [state[key].shape for key in weights]
        hidden = tuple(shape[0] for shape in shapes[:-1])
        generator = torch.Generator().manual_seed(0)
        network = BoundedNet(shapes[0][1], hidden, ACTIVATION, generator)
        network.load_state_dict(dict(state))
    except (IndexError, RuntimeError) as error:
        raise ModelError(name, expected="a published state dictionary", found=str(error)) from error
    return network


def _from_archive(path: Path) -> dict[str, State]:
    states: dict[str, dict[str, Tensor]] = {}
    with np.load(path, allow_pickle=False) as data:
        for key in data.files:
            checkpoint, _, parameter = key.partition("/")
            states.setdefault(checkpoint, {})[parameter] = torch.from_numpy(data[key])
    return dict(states)


def _from_clone(folder: Path) -> dict[str, State]:
    states: dict[str, State] = {}
    for path in sorted(folder.rglob("*.pt")):
        try:
            content = torch.load(path, map_location="cpu", weights_only=True)
        except (pickle.UnpicklingError, RuntimeError, EOFError) as error:
            raise ModelError(str(path), expected="weights only", found=str(error)) from error
        states[path.stem] = _state_in(content, path)
    return states


def _state_in(content: object, path: Path) -> State:
    """Return the state dictionary in a file, which may hold settings beside it."""
    candidates = [content]
    if isinstance(content, Mapping):
        candidates += content.values()
    for candidate in candidates:
        if isinstance(candidate, Mapping) and any(
            isinstance(value, Tensor) for value in candidate.values()
        ):
            return {
                # Some are saved from a module that holds the network.
                "net." + key.rpartition("net.")[2]: value
                for key, value in candidate.items()
                if "net." in key
            }
    raise ModelError(str(path), expected="a state dictionary", found=type(content).__name__)
