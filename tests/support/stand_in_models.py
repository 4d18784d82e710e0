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

    def run(self, given: str, rows: np.ndarray, budget: float = 1.0) -> np.ndarray:
        return np.zeros((len(rows), 3))


class CountedModel(ZeroModel):
    """A model that counts how often it is sent somewhere; it arrives as a ZeroModel."""

    pickled = 0

    def __reduce__(self) -> tuple[object, ...]:
        CountedModel.pickled += 1
        return (ZeroModel, ())
