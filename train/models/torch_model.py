"""A torch network as the operator's model, so that training and product share one harness."""

import hashlib
from dataclasses import asdict, dataclass

import numpy as np
import safetensors.torch
import torch
from jaxtyping import Float
from torch import Tensor, nn

from pns_common.model.card import DIRECTED_FORMAT, PAPER_FORMAT, ModelCard
from pns_common.model.session import networks
from train.models.directed import DirectedNet
from train.models.networks import BoundedNet
from train.models.recipe import Recipe


@dataclass(frozen=True, eq=False)
class TorchModel:
    """A network with a model card; it keeps the library's `Model` protocol."""

    name: str
    card: ModelCard
    network: BoundedNet | DirectedNet

    @property
    def hash(self) -> str:
        """The sha256 of the weights."""
        return hashlib.sha256(safetensors.torch.save(self.network.state_dict())).hexdigest()

    def run(
        self, given: str, rows: Float[np.ndarray, "N K"], budget: float = 1.0
    ) -> Float[np.ndarray, "N A"]:
        """Return the answers, in the network's own precision."""
        own = next(self.network.parameters()).dtype
        read = torch.from_numpy(np.ascontiguousarray(rows)).to(own)
        with torch.no_grad():
            if isinstance(self.network, BoundedNet):
                return self.network(read, budget).numpy()
            return answered(layers_of(self.network, self.card)[given], read).numpy()


# Weight and bias; without a bias what the weight does not read of a row is added.
Layer = tuple[Float[Tensor, "A B"], Float[Tensor, " A"] | None]


def layers_of(network: DirectedNet, card: ModelCard) -> dict[str, list[Layer]]:
    """Return the layers of each network of a model file, by what it reads.

    In a round the first layer is linear in what both vertices pooled: that part of it is computed
    once a vertex, not once an edge.
    """
    encoder, *rounds, heads = (
        [(part.weight, part.bias) for part in module.modules() if isinstance(part, nn.Linear)]
        for module in (network.encoder, *network.rounds, network.heads)
    )
    parts: list[list[Layer]] = [list(encoder)]
    size = 2 * network.width
    for (weight, bias), last in rounds:
        own, leaving, reaching = weight.split(size, dim=1)
        told = torch.cat([leaving, reaching]), torch.cat([bias, torch.zeros_like(bias)])
        parts += [[told], [(own, None), last]]
    parts.append(list(heads))
    return {each.given: part for each, part in zip(networks(card), parts, strict=True)}


def answered(layers: list[Layer], rows: Float[Tensor, "N K"]) -> Float[Tensor, "N A"]:
    """Return what layers answer, with SiLU between them."""
    for number, (weight, bias) in enumerate(layers):
        read, more = rows.split([weight.shape[1], rows.shape[1] - weight.shape[1]], dim=1)
        rows = read @ weight.T + (more if bias is None else bias)
        rows = rows if number == len(layers) - 1 else nn.functional.silu(rows)
    return rows


def recipe_model(recipe: Recipe, network: BoundedNet | DirectedNet) -> TorchModel:
    """Return a recipe's network as a model whose card has no metrics yet."""
    return TorchModel(recipe.name, card_of(recipe), network)


def card_of(recipe: Recipe) -> ModelCard:
    """Return what a model card says of a recipe's rule, without training and metrics."""
    rule = {} if recipe.directed is None else asdict(recipe.directed)
    if rule:
        rule["boundary_strength"] = rule.pop("curve_strength")
    own = {
        "features": recipe.features,
        "gate_sharpness": recipe.gate_sharpness,
        "budget": recipe.budget,
        "orientation": recipe.orientation,
    }
    version = DIRECTED_FORMAT if rule else PAPER_FORMAT
    return ModelCard(format=version, training={}, metrics={}, **(own | rule))
