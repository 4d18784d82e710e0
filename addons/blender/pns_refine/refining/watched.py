"""A model that looks up from its work: between two blocks of rows it asks whether to go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from pns_common.model.card import ModelCard
from pns_common.model.session import Model


@dataclass(frozen=True, eq=False)
class WatchedModel:
    """A model that calls ``look_up`` before each block, which may raise to stop the work."""

    model: Model
    look_up: Callable[[], None]

    @property
    def card(self) -> ModelCard:
        """The model's card."""
        return self.model.card

    @property
    def name(self) -> str:
        """Name in reports."""
        return self.model.name

    @property
    def hash(self) -> str:
        """The sha256 of the model file."""
        return self.model.hash

    @property
    def feature_type(self) -> type[np.floating[Any]]:
        """The floating type in which features are best given."""
        return getattr(self.model, "feature_type", np.float64)

    def run(
        self, given: str, rows: Float[np.ndarray, "N K"], budget: float = 1.0
    ) -> Float[np.ndarray, "N A"]:
        """Return the answers of a network to a block of rows."""
        self.look_up()
        return self.model.run(given, rows, budget)
