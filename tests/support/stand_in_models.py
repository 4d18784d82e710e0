"""Models for the service's tests, that cross to its workers by pickling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pns_common.model.card import ModelCard

ZERO_CARD = ModelCard(1, "paper-5", 10.0, 0.5, "first-face", {}, {})


@dataclass(frozen=True)
class ZeroModel:
    """A model that corrects nothing, and crosses to the workers by pickling."""

    card: ModelCard = ZERO_CARD
    name: str = "zero"
    hash: str = "0" * 64

    def __call__(self, features: np.ndarray, budget: float) -> np.ndarray:
        return np.zeros((len(features), 3))

    def vertex_correction(self, features: np.ndarray, budget: float) -> np.ndarray:
        return np.zeros((len(features), 3))

    def sharpness(self, features: np.ndarray) -> np.ndarray:
        return np.zeros((len(features), 1))


class CountedModel(ZeroModel):
    """A model that counts how often it is sent somewhere; it arrives as a ZeroModel."""

    pickled = 0

    def __reduce__(self) -> tuple[object, ...]:
        CountedModel.pickled += 1
        return (ZeroModel, ())


class Constant:
    """A model whose networks say one number for edges, one for vertices, and one of sharpness."""

    name, hash = "constant", "0" * 64

    def __init__(self, card, edges, vertices, sharpness=0.0):
        self.card, self.edges, self.vertices, self.sharp = card, edges, vertices, sharpness

    def __call__(self, features, budget):
        return np.full((len(features), 3), self.edges)

    def vertex_correction(self, features, budget):
        return np.full((len(features), 3), self.vertices)

    def sharpness(self, features):
        return np.full((len(features), 1), self.sharp)
