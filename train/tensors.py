"""Rows of three numbers in torch, with gradients that are 0, not NaN, where a length is 0."""

import torch
from jaxtyping import Float
from torch import Tensor


def dot(u: Tensor, v: Tensor) -> Tensor:
    """Return the inner products of the last axis."""
    return (u * v).sum(dim=-1)


def root(square: Tensor) -> Tensor:
    """Return the square root, with gradient 0 at 0."""
    positive = square > 0
    return torch.where(positive, torch.where(positive, square, 1.0).sqrt(), 0.0)


def ratio(values: Tensor, by: Tensor) -> Tensor:
    """Return values / by, and 0 where `by` is 0."""
    positive = by > 0
    return torch.where(positive, values / torch.where(positive, by, 1.0), 0.0)


def unit(vectors: Tensor, shortest: Tensor | float = 0.0) -> Tensor:
    """Return vectors longer than `shortest` at length 1, and 0 in place of others."""
    length = root(dot(vectors, vectors))
    kept = torch.where(length > shortest, length, 0.0)
    return ratio(vectors, kept[..., None])


def shortened(vectors: Float[Tensor, "N 3"], longest: Tensor) -> Float[Tensor, "N 3"]:
    """Return Π_ρ: vectors longer than `longest` shortened to it."""
    length = root(dot(vectors, vectors))
    return vectors * torch.where(length > longest, ratio(longest, length), 1.0)[:, None]
