"""Model files of the author's published networks."""

from pathlib import Path

from export.model_file import Exported, write_model
from pns_common.errors import ModelError
from pns_common.model.card import PAPER_FORMAT, ModelCard
from train.models.published import GATE_SHARPNESS, is_operator, load_published, published_budget

SOURCE = "https://github.com/ugail/Proximity-Preserving-Neural-Subdivision"

# Two of these networks round to 1.5e-6 in float32 on slivers of e^±30, in torch as well.
PARITY = 2e-6


def export_published(published: Path, folder: Path) -> dict[Path, Exported]:
    """Write one model file for each published network that is the operator itself.

    Ablated and unconstrained networks are left out: no file of theirs would keep the contract.

    Raises:
        ModelError: nothing to export there, or a network is not what it should be.
        ParityError: a file would not say what its network says.
    """
    networks = {
        name: network for name, network in load_published(published).items() if is_operator(name)
    }
    if not networks:
        raise ModelError(str(published), expected="PNS checkpoints", found="others only")
    written: dict[Path, Exported] = {}
    for name, network in networks.items():
        card = ModelCard(
            format=PAPER_FORMAT,
            features="paper-5",
            gate_sharpness=GATE_SHARPNESS,
            budget=published_budget(name),
            orientation="first-face",
            training={"source": SOURCE, "checkpoint": name},
            metrics={},
        )
        path = folder / f"{name}.onnx"
        written[path] = write_model(network, card, path, PARITY)
    return written
