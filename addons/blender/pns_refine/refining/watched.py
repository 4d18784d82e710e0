"""A model that looks up from its work: between two blocks of rows it asks whether to go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from jaxtyping import Float

from pns_common.model.card import ModelCard
from pns_common.model.session import DirectedModel, Model, PolygonModel


@dataclass(frozen=True, eq=False)
class WatchedModel:
    """The same model; ``look_up`` is called before each block, and may raise to stop the work."""

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

    def __call__(self, features: Float[np.ndarray, "N K"], budget: float) -> np.ndarray:
        """Return corrections of a block of edges."""
        self.look_up()
        return self.model(features, budget)

    def vertex_correction(self, features: Float[np.ndarray, "N L"], budget: float) -> np.ndarray:
        """Return corrections of a block of vertices."""
        self.look_up()
        return self.model.vertex_correction(features, budget)

    def face_correction(self, features: Float[np.ndarray, "N K"], budget: float) -> np.ndarray:
        """Return corrections of a block of faces."""
        self.look_up()
        return cast(PolygonModel, self.model).face_correction(features, budget)

    def run(self, given: str, rows: Float[np.ndarray, "N K"]) -> np.ndarray:
        """Return the answers of a network of directed edges."""
        self.look_up()
        return cast(DirectedModel, self.model).run(given, rows)

    def sharpness(self, features: Float[np.ndarray, "N P"]) -> np.ndarray:
        """Return the sharpness of a block of edges."""
        self.look_up()
        return self.model.sharpness(features)
