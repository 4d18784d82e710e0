"""A torch network as the operator's model, so that training and product share one harness."""

import hashlib
from dataclasses import asdict, dataclass

import numpy as np
import safetensors.torch
import torch
from jaxtyping import Float

from pns_common import ModelError
from pns_common.model.card import DEFAULT_FORMAT, PAPER_FORMAT, ModelCard
from train.models.checkpoint import joined_state
from train.models.networks import BoundedNet, SharpNet
from train.models.recipe import Recipe


@dataclass(frozen=True, eq=False)
class TorchModel:
    """Networks with a model card; they keep the library's `Model` protocol.

    `vertex_network` goes with the card's vertex features; `sharpness_network`, whose sigmoid is the
    sharpness, with its sharpness features; `face_network` with its face features.
    """

    name: str
    card: ModelCard
    network: BoundedNet
    vertex_network: BoundedNet | None = None
    sharpness_network: SharpNet | None = None
    face_network: BoundedNet | None = None

    @property
    def hash(self) -> str:
        """The sha256 of the weights."""
        weights = joined_state(
            self.network, self.vertex_network, self.sharpness_network, self.face_network
        )
        return hashlib.sha256(safetensors.torch.save(weights)).hexdigest()

    def __call__(
        self, features: Float[np.ndarray, "E K"], budget: float
    ) -> Float[np.ndarray, "E 3"]:
        """Return the corrections, in the network's own precision."""
        return _answer(self.network, features, budget)

    def vertex_correction(
        self, features: Float[np.ndarray, "N L"], budget: float
    ) -> Float[np.ndarray, "N 3"]:
        """Return the weights for the rings of old vertices, likewise.

        Raises:
            ModelError: there is no vertex network.
        """
        if self.vertex_network is None:
            raise ModelError(self.name, expected="a vertex rule", found="none")
        return _answer(self.vertex_network, features, budget)

    def face_correction(
        self, features: Float[np.ndarray, "N M"], budget: float
    ) -> Float[np.ndarray, "N 1"]:
        """Return lengths along the normals of faces.

        Raises:
            ModelError: there is no face network.
        """
        if self.face_network is None:
            raise ModelError(self.name, expected="a face network", found="none")
        return _answer(self.face_network, features, budget)

    def sharpness(self, features: Float[np.ndarray, "N P"]) -> Float[np.ndarray, "N 1"]:
        """Return the sharpness of edges.

        Raises:
            ModelError: there is no sharpness network.
        """
        if self.sharpness_network is None:
            raise ModelError(self.name, expected="a sharpness network", found="none")
        own = self.sharpness_network.linear_layers[0].weight.dtype
        with torch.no_grad():
            answer = self.sharpness_network(torch.from_numpy(features).to(own))
            return torch.sigmoid(answer).numpy()


def _answer(
    network: BoundedNet, features: Float[np.ndarray, "N K"], budget: float
) -> Float[np.ndarray, "N A"]:
    own = network.linear_layers[0].weight.dtype
    with torch.no_grad():
        return network(torch.from_numpy(features).to(own), budget).numpy()


def recipe_model(
    recipe: Recipe,
    network: BoundedNet,
    vertex_network: BoundedNet | None = None,
    sharpness_network: SharpNet | None = None,
    face_network: BoundedNet | None = None,
) -> TorchModel:
    """Return a recipe's networks as a model whose card has no metrics yet."""
    rule, form, sharpness = recipe.vertex, recipe.scale_free, recipe.sharpness
    face = recipe.face
    card = ModelCard(
        format=PAPER_FORMAT if form is None else DEFAULT_FORMAT,
        features=recipe.features,
        gate_sharpness=recipe.gate_sharpness,
        budget=recipe.budget,
        orientation=recipe.orientation,
        training={},
        metrics={},
        vertex_features=None if rule is None else rule.features,
        vertex_gate_sharpness=None if rule is None else rule.gate_sharpness,
        sharpness_features=None if sharpness is None else sharpness.features,
        face_features=None if face is None else face.features,
        **({} if form is None else asdict(form)),
    )
    return TorchModel(recipe.name, card, network, vertex_network, sharpness_network, face_network)
