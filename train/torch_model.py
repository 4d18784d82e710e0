"""A torch network as the operator's model, so that training and product share one harness."""

import hashlib
from dataclasses import dataclass

import numpy as np
import safetensors.torch
import torch
from jaxtyping import Float

from pns_common.model_card import FORMAT, ModelCard
from train.networks import BoundedNet
from train.recipes import Recipe


@dataclass(frozen=True, eq=False)
class TorchModel:
    """A network with a model card; it keeps the `Model` protocol of pns_common.schemes."""

    name: str
    card: ModelCard
    network: BoundedNet

    @property
    def hash(self) -> str:
        """The sha256 of the weights."""
        return hashlib.sha256(safetensors.torch.save(self.network.state_dict())).hexdigest()

    def __call__(
        self, features: Float[np.ndarray, "E K"], budget: float
    ) -> Float[np.ndarray, "E 3"]:
        """Return the corrections, in the network's own precision."""
        own = self.network.linear_layers[0].weight.dtype
        with torch.no_grad():
            return self.network(torch.from_numpy(features).to(own), budget).numpy()


def recipe_model(recipe: Recipe, network: BoundedNet) -> TorchModel:
    """Return a recipe's network as a model whose card has no metrics yet."""
    card = ModelCard(
        format=FORMAT,
        features=recipe.features,
        gate_sharpness=recipe.gate_sharpness,
        budget=recipe.budget,
        orientation=recipe.orientation,
        training={},
        metrics={},
    )
    return TorchModel(recipe.name, card, network)
