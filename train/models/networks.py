"""The correction network: edge features to a vector in the ball of radius C."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import cast

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from pns_common.model.card import EDGE_FEATURES
from pns_common.model.features import Symmetries

# The coordinates of a, b, c, d: what the unconstrained network sees instead of features.
RAW_COORDINATES = "raw-12"

INPUT_COUNT: Mapping[str, int] = {**EDGE_FEATURES, RAW_COORDINATES: 12}

# nn.GELU is the exact one, x Φ(x) with erf, unless told otherwise.
ACTIVATIONS: Mapping[str, Callable[[], nn.Module]] = {
    "gelu": nn.GELU,
    "silu": nn.SiLU,
    "tanh": nn.Tanh,
}


class BoundedNet(nn.Module):
    """A small perceptron whose output never leaves the ball: η = C z / max(1, ‖z‖).

    The bound holds for any weights. Its layers are `net.0`, `net.2`, …, as in the published state
    dictionaries. Source: paper, PNS operator and algorithm.
    """

    def __init__(
        self,
        feature_count: int,
        hidden: tuple[int, ...],
        activation: str,
        generator: torch.Generator,
    ):
        super().__init__()
        self.activation = activation
        self.net = perceptron((feature_count, *hidden, 3), activation, generator)

    def forward(
        self, features: Float[Tensor, "E K"], budget: float | Float[Tensor, ""]
    ) -> Float[Tensor, "E 3"]:
        """Return η with ‖η‖ ≤ budget."""
        z = self.raw(features)
        return budget * z / torch.linalg.vector_norm(z, dim=-1, keepdim=True).clamp(min=1)

    def raw(self, features: Float[Tensor, "E K"]) -> Float[Tensor, "E 3"]:
        """Return z, of any length."""
        return self.net(features)

    @property
    def linear_layers(self) -> list[nn.Linear]:
        """The layers that hold weights, from features to z."""
        return [layer for layer in self.net if isinstance(layer, nn.Linear)]


class SymmetricNet(BoundedNet):
    """A bounded perceptron averaged over a group: z ← mean over g of D_g z(g φ), then projected.

    η(g φ) = D_g η(φ) then holds for any weights, and ‖η‖ ≤ C as before.
    """

    order: Tensor
    signs: Tensor
    local: Tensor

    def __init__(
        self,
        group: Symmetries,
        hidden: tuple[int, ...],
        activation: str,
        generator: torch.Generator,
    ):
        super().__init__(group.order.shape[1], hidden, activation, generator)
        self.group = group
        self.register_buffer("order", torch.from_numpy(group.order), persistent=False)
        self.register_buffer("signs", _single(group.signs), persistent=False)
        self.register_buffer("local", _single(group.local), persistent=False)

    def raw(self, features: Float[Tensor, "E K"]) -> Float[Tensor, "E 3"]:
        """Return the averaged z, of any length."""
        images = features[:, self.order] * self.signs
        return (self.net(images) * self.local).mean(dim=1)


def unit_correction(network: BoundedNet) -> Callable[[Tensor], Tensor]:
    """Return the network at budget 1 as the operator's callable: float64 in and out.

    The geometry is float64, the network keeps its own precision, as in the product.
    """

    def correction(features: Float[Tensor, "E K"]) -> Float[Tensor, "E 3"]:
        own = network.linear_layers[0].weight.dtype
        return network(features.to(own), 1.0).to(features.dtype)

    return correction


def _single(values: Float[np.ndarray, "..."]) -> Float[Tensor, "..."]:
    # Every entry is 1 or −1: exact in any precision that the network is turned to.
    return torch.from_numpy(values.astype(np.float32))


def perceptron(
    widths: tuple[int, ...], activation: str, generator: torch.Generator
) -> nn.Sequential:
    """Return linear layers from each width to the next, and activations between them."""
    layers: list[nn.Module] = []
    for fan_in, fan_out in pairwise(widths):
        layers += [_seeded_linear(fan_in, fan_out, generator), ACTIVATIONS[activation]()]
    return nn.Sequential(*layers[:-1])


def _seeded_linear(fan_in: int, fan_out: int, generator: torch.Generator) -> nn.Linear:
    """Return a linear layer with torch's default distribution, drawn from our own generator.

    Weights and biases are uniform in ± 1/√fan_in; nn.Linear itself would draw them from the
    process-wide generator.
    """
    layer = cast(nn.Linear, nn.utils.skip_init(nn.Linear, fan_in, fan_out))
    bound = fan_in**-0.5
    with torch.no_grad():
        layer.weight.uniform_(-bound, bound, generator=generator)
        layer.bias.uniform_(-bound, bound, generator=generator)
    return layer
