"""Networks whose weights are tied by a group of symmetries: exactly equivariant, evaluated once.

A hidden layer is m copies of the group's regular representation: its units are pairs (g, i), in
this order, and a symmetry s of the features takes what unit (g, i) says to unit (g s, i). With
z(s φ) = D_s z(φ) as the aim, for an abelian group with (g φ)_k = signs[g, k] φ[order[g, k]]:

    first layer     row (g, i) is W_i, permuted and signed by g
    hidden layers   entry ((g, i), (h, j)) is K_ij[g h]
    biases          the same for all g
    last layer      column (g, i) is D_g v_i; its bias is what all D_g leave alone

Every weight is an entry of W, K or v up to its sign, so the network is an ordinary dense one to
whoever evaluates it, and the symmetry holds up to the rounding of sums in another order.
"""

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn.utils import parametrize

from pns_common.model.features import Symmetries


def _tie(layer: nn.Linear, weight: nn.Module, bias: nn.Module) -> None:
    parametrize.register_parametrization(layer, "weight", weight)
    parametrize.register_parametrization(layer, "bias", bias)


class _TiedFirst(nn.Module):
    """W (m, K) as rows (g, i): W_i g."""

    place: Tensor
    signs: Tensor

    def __init__(self, group: Symmetries):
        super().__init__()
        # (W g)[j] with j = order[g, k] is W[k] signs[g, k].
        place = np.argsort(group.order, axis=1)
        signs = np.take_along_axis(group.signs, place, axis=1)
        self.register_buffer("place", torch.from_numpy(place), persistent=False)
        self.register_buffer("signs", _signs(signs), persistent=False)

    def forward(self, free: Float[Tensor, "m K"]) -> Float[Tensor, "Gm K"]:
        images = free[:, self.place] * self.signs  # (m, G, K)
        return images.transpose(0, 1).flatten(0, 1)

    def right_inverse(self, dense: Float[Tensor, "Gm K"]) -> Float[Tensor, "m K"]:
        return dense[: len(dense) // len(self.place)].clone()


class _TiedHidden(nn.Module):
    """K (m, G n) as entries ((g, i), (h, j)): K_ij[g h]; side by side for several layers read."""

    product: Tensor

    def __init__(self, size: int, inputs: int = 1):
        super().__init__()
        self.inputs = inputs
        self.register_buffer("product", torch.from_numpy(product(size)), persistent=False)

    def forward(self, free: Float[Tensor, "m Gn"]) -> Float[Tensor, "Gm Gn"]:
        size = len(self.product)
        blocks = free.reshape(len(free), self.inputs, size, -1)[:, :, self.product]
        # (m, inputs, G, G, n), of which the first G numbers rows.
        return blocks.permute(2, 0, 1, 3, 4).reshape(size * len(free), -1)

    def right_inverse(self, dense: Float[Tensor, "Gm Gn"]) -> Float[Tensor, "m Gn"]:
        return dense[: len(dense) // len(self.product)].clone()


class _TiedLast(nn.Module):
    """v (A, m) as columns (g, i): D_g v_i."""

    local: Tensor

    def __init__(self, group: Symmetries):
        super().__init__()
        self.register_buffer("local", _signs(group.local), persistent=False)

    def forward(self, free: Float[Tensor, "A m"]) -> Float[Tensor, "A Gm"]:
        return (self.local.T[:, :, None] * free[:, None, :]).flatten(1)

    def right_inverse(self, dense: Float[Tensor, "A Gm"]) -> Float[Tensor, "A m"]:
        return dense[:, : dense.shape[1] // len(self.local)].clone()


class _Repeated(nn.Module):
    """A bias of m numbers, for each g."""

    def __init__(self, size: int):
        super().__init__()
        self.size = size

    def forward(self, free: Float[Tensor, " m"]) -> Float[Tensor, " Gm"]:
        return free.repeat(self.size)

    def right_inverse(self, dense: Float[Tensor, " Gm"]) -> Float[Tensor, " m"]:
        return dense[: len(dense) // self.size].clone()


class _Invariant(nn.Module):
    """The part of a bias that every D_g leaves alone."""

    kept: Tensor

    def __init__(self, group: Symmetries):
        super().__init__()
        kept = (group.local == 1).all(axis=0).astype(float)
        self.register_buffer("kept", _signs(kept), persistent=False)

    def forward(self, free: Float[Tensor, " A"]) -> Float[Tensor, " A"]:
        return free * self.kept

    def right_inverse(self, dense: Float[Tensor, " A"]) -> Float[Tensor, " A"]:
        return dense


def product(size: int) -> Int[np.ndarray, "G G"]:
    """Return where g h stands in a group made of commuting generators of order two.

    `symmetries` numbers them by which generators they are made of, one bit each.
    """
    return np.bitwise_xor.outer(np.arange(size), np.arange(size))


def _signs(values: Float[np.ndarray, "..."]) -> Float[Tensor, "..."]:
    # 1, 0 and −1 are exact in any precision that the network is turned to.
    return torch.from_numpy(values.astype(np.float32))
