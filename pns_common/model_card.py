"""The model card: what a model file says of itself, as JSON in its metadata."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec

from pns_common.features import FEATURE_SETS
from pns_common.orientation import ORIENTATIONS

# The metadata key of an ONNX file that holds the card.
CARD_KEY = "pns_card"
FORMAT = 1


@dataclass(frozen=True)
class ModelCard:
    """What a model file says of itself (card format 1).

    Attributes:
        format: version of the file format.
        features: name of the feature set that the network reads.
        gate_sharpness: c of the gate γ = tanh(c x²).
        budget: C that the model was trained at, and the default.
        orientation: how (a, b, c, d) are ordered: "first-face" or "symmetric".
        training: recipe, seed and whatever else fixes the training; no dates.
        metrics: measured on held-out data.
    """

    format: int
    features: str
    gate_sharpness: float
    budget: float
    orientation: str
    training: dict[str, Any]
    metrics: dict[str, Any]

    def to_json(self) -> str:
        """The card as JSON, keys in the order of the attributes."""
        return msgspec.json.encode(self).decode()

    @staticmethod
    def from_json(text: str) -> ModelCard:
        """Read a card.

        Raises:
            ValueError: it is not JSON, a field is missing, unknown or of the wrong type, or its
                value is not one that this version knows.
        """
        fields = msgspec.json.decode(text, type=dict[str, Any])
        unknown = sorted(set(fields) - set(ModelCard.__dataclass_fields__))
        if unknown:
            raise ValueError(f"unknown fields {', '.join(unknown)}")
        card = msgspec.convert(fields, ModelCard)
        problem = _problem(card)
        if problem:
            raise ValueError(problem)
        return card


def _problem(card: ModelCard) -> str | None:
    """What is wrong with the card's values, or None."""
    if card.format != FORMAT:
        return f"format {card.format}, not {FORMAT}"
    if card.features not in FEATURE_SETS:
        return f"features {card.features!r}, not one of {', '.join(FEATURE_SETS)}"
    if card.orientation not in ORIENTATIONS:
        return f"orientation {card.orientation!r}, not one of {', '.join(ORIENTATIONS)}"
    if not (math.isfinite(card.gate_sharpness) and card.gate_sharpness > 0):
        return f"gate_sharpness {card.gate_sharpness}, not a finite number > 0"
    if not (math.isfinite(card.budget) and card.budget > 0):
        return f"budget {card.budget}, not a finite number > 0"
    return None
