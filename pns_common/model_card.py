"""The model card: what a model file says of itself, as JSON in its metadata.

Format 1 knows a network for interior edges; format 2 may have a second one, for old vertices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec

from pns_common.features import FEATURE_SETS
from pns_common.orientation import ORIENTATIONS
from pns_common.ring_features import RING_FEATURE_SETS

# The metadata key of an ONNX file that holds the card.
CARD_KEY = "pns_card"
FORMAT, VERTEX_FORMAT = 1, 2
FORMATS = (FORMAT, VERTEX_FORMAT)


@dataclass(frozen=True)
class ModelCard:
    """What a model file says of itself.

    Attributes:
        format: version of the file format.
        features: name of the feature set that the network reads.
        gate_sharpness: c of the gate γ = tanh(c x²).
        budget: C that the model was trained at, and the default.
        orientation: how (a, b, c, d) are ordered: "first-face" or "symmetric".
        training: recipe, seed and whatever else fixes the training; no dates.
        metrics: measured on held-out data.
        vertex_features: name of the feature set that the vertex network reads; None where the
            model leaves old vertices to Loop. Format 2.
        vertex_gate_sharpness: c of the gate γ_v = tanh(c x_v), with ``vertex_features``.
    """

    format: int
    features: str
    gate_sharpness: float
    budget: float
    orientation: str
    training: dict[str, Any]
    metrics: dict[str, Any]
    vertex_features: str | None = None
    vertex_gate_sharpness: float | None = None

    def to_json(self) -> str:
        """The card as JSON, keys in the order of the attributes; without those that are None."""
        fields = {name: getattr(self, name) for name in ModelCard.__dataclass_fields__}
        return msgspec.json.encode({k: v for k, v in fields.items() if v is not None}).decode()

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
    if card.format not in FORMATS:
        return f"format {card.format}, not {' or '.join(map(str, FORMATS))}"
    if card.features not in FEATURE_SETS:
        return f"features {card.features!r}, not one of {', '.join(FEATURE_SETS)}"
    if card.orientation not in ORIENTATIONS:
        return f"orientation {card.orientation!r}, not one of {', '.join(ORIENTATIONS)}"
    if not (math.isfinite(card.gate_sharpness) and card.gate_sharpness > 0):
        return f"gate_sharpness {card.gate_sharpness}, not a finite number > 0"
    if not (math.isfinite(card.budget) and card.budget > 0):
        return f"budget {card.budget}, not a finite number > 0"
    return _vertex_problem(card)


def _vertex_problem(card: ModelCard) -> str | None:
    """What is wrong with the fields of the vertex network, or None."""
    name, sharpness = card.vertex_features, card.vertex_gate_sharpness
    if name is None and sharpness is None:
        return None
    if card.format < VERTEX_FORMAT:
        return f"vertex fields in format {card.format}, not {VERTEX_FORMAT}"
    if name is None or sharpness is None:
        return "one of vertex_features and vertex_gate_sharpness without the other"
    if name not in RING_FEATURE_SETS:
        return f"vertex_features {name!r}, not one of {', '.join(RING_FEATURE_SETS)}"
    if not (math.isfinite(sharpness) and sharpness > 0):
        return f"vertex_gate_sharpness {sharpness}, not a finite number > 0"
    return None
