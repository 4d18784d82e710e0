"""What a model is to the operator: one network or two, and a card that says how to use them."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from pns_common.base.arrays import Array
from pns_common.models.card import ModelCard


@runtime_checkable
class Model(Protocol):
    """A per-edge network with its card; ``model(features, budget)`` has norm ≤ budget."""

    @property
    def card(self) -> ModelCard:
        """What the model says of itself."""
        ...

    @property
    def name(self) -> str:
        """How reports call it."""
        ...

    @property
    def hash(self) -> str:
        """The sha256 of the model file."""
        ...

    def __call__(self, features: Array, budget: float) -> Array:
        """Return η of equation 1, or z in format 3: (N, 3) in edge frames, for features (N, K)."""
        ...


@runtime_checkable
class VertexModel(Model, Protocol):
    """A model with a second network, for old vertices."""

    def vertex_correction(self, features: Array, budget: float) -> Array:
        """Return weights (N, 3) of the ring's three vectors for features (N, L); norm ≤ budget."""
        ...
