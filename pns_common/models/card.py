"""The model card: what a model file says of itself, as JSON in its metadata.

Format 1 knows a network for interior edges; format 2 may have a second one, for old vertices.
Format 3 has both, and the four numbers of the scale-free rule (pns_common/rules/scale_free.py).
"""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, dataclass, fields
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.orientation import ORIENTATIONS
from pns_common.features.ring_features import RING_FEATURE_SETS
from pns_common.formula.prior_strength import HIGHEST_STRENGTH

# The metadata key of an ONNX file that holds the card.
CARD_KEY = "pns_card"
FORMAT, VERTEX_FORMAT, SCALE_FREE_FORMAT = 1, 2, 3
FORMATS = (FORMAT, VERTEX_FORMAT, SCALE_FREE_FORMAT)
SCALE_FREE_FIELDS = ("learned_levels", "prior_strength", "network_scale", "fold_angle")
OPTIONAL_FIELDS = (
    "boundary_strength",
    "side_gates",
    "network_altitudes",
    "wide_bound",
    "crease_prior",
    "tip_strength",
    "even_prior_strength",
)
STRENGTHS = ("prior_strength", "even_prior_strength", "boundary_strength", "tip_strength")
CREASE_FIELDS = ("crease_angle", "crease_levels", "edged_crease_angle")
MOST_LEARNED_LEVELS = 16


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
        learned_levels: K, the levels at which the model acts; after them it is Loop. Format 3, as
            all that follow.
        prior_strength: s of the prior, 0 … 100, as all strengths; 1 is full quasi-interpolation.
        network_scale: τ > 0, the longest that the network may ask for, in edge lengths.
        fold_angle: θ of the fold guard, degrees between 0 and 90.
        boundary_strength: b ≥ 0 of the boundary's prior; None leaves boundaries to Loop.
        side_gates: whether an edge's gate reads the sides of its two faces beside their normals;
            None is false.
        network_altitudes: α > 0, the longest that τ's unit may be, in altitudes of an edge's
            thinner face; None counts edge lengths alone.
        wide_bound: whether h of an edge's bound is the longest edge of its two faces; None is
            false.
        crease_prior: whether the boundary's prior acts at creases too; None is false.
        tip_strength: a ≥ 0, how much of Loop's own move is given back at tips; None is 0.
        even_prior_strength: s₁ ≥ 0 of the prior where a mesh is even (formula/prior_strength.py);
            None is ``prior_strength``.
        crease_angle: θ of the crease lines that are kept where no creases are named, degrees
            between 0 and 180; None looks for none.
        crease_levels: at how many levels they are sharp, at least 1; with ``crease_angle``.
        edged_crease_angle: θ' < θ of those of edged meshes, and beside plane sides, degrees
            (geometry/crease_lines); None keeps none between the two.
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
    learned_levels: int | None = None
    prior_strength: float | None = None
    network_scale: float | None = None
    fold_angle: float | None = None
    boundary_strength: float | None = None
    side_gates: bool | None = None
    network_altitudes: float | None = None
    wide_bound: bool | None = None
    crease_prior: bool | None = None
    tip_strength: float | None = None
    even_prior_strength: float | None = None
    crease_angle: float | None = None
    crease_levels: int | None = None
    edged_crease_angle: float | None = None

    def to_json(self) -> str:
        """Return the card as JSON, keys in the order of the attributes; none that is None."""
        import msgspec  # to write a card; reading one needs the standard library alone

        values = {field.name: getattr(self, field.name) for field in fields(self)}
        given = {name: value for name, value in values.items() if value is not None}
        return msgspec.json.encode(given).decode()

    @staticmethod
    def from_json(text: str) -> ModelCard:
        """Read a card.

        Raises:
            ValueError: it is not JSON, a field is missing, unknown or of the wrong type, or its
                value is not one that this version knows.
        """
        card = ModelCard(**_typed_fields(_json_object(text)))
        problem = _problem(card)
        if problem:
            raise ValueError(problem)
        return card


def _json_object(text: str) -> dict[str, Any]:
    """Read the object that a text of JSON holds. Raises ValueError."""

    def no_number(word: str) -> None:
        raise ValueError(f"{word}, which is no number of JSON")

    try:
        value: Any = json.loads(text, parse_constant=no_number)
    except RecursionError as error:
        raise ValueError("nested too deep") from error
    match value:
        case dict():
            return dict(value)  # pyright: ignore[reportUnknownArgumentType]
        case _:
            raise ValueError(f"{type(value).__name__}, not an object")


def _typed_fields(values: dict[str, Any]) -> dict[str, Any]:
    """Return a card's fields, each of its type; a whole number will do for a float."""
    known = {field.name: field for field in fields(ModelCard)}
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise ValueError(f"unknown fields {', '.join(unknown)}")
    missing = [n for n, f in known.items() if f.default is MISSING and n not in values]
    if missing:
        raise ValueError(f"missing fields {', '.join(missing)}")
    hints = get_type_hints(ModelCard)
    for name, value in values.items():
        if not any(_is_one(value, kind) for kind in _kinds(hints[name])):
            raise ValueError(f"{name} of type {type(value).__name__}")
    return values


def _kinds(hint: Any) -> tuple[Any, ...]:
    """Return the types that a hint allows: a union's, else one; containers without items."""
    kinds = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return tuple(get_origin(kind) or kind for kind in kinds)


def _is_one(value: Any, kind: type) -> bool:
    if isinstance(value, bool):
        return kind is bool
    return isinstance(value, (int, float) if kind is float else kind)


def _problem(card: ModelCard) -> str | None:
    """Return what is wrong with the card's values, or None."""
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
    return _vertex_problem(card) or _scale_free_problem(card)


def _vertex_problem(card: ModelCard) -> str | None:
    """Return what is wrong with the fields of the vertex network, or None."""
    name, gate_sharpness = card.vertex_features, card.vertex_gate_sharpness
    if name is None and gate_sharpness is None:
        return None
    if card.format < VERTEX_FORMAT:
        return f"vertex fields in format {card.format}, not {VERTEX_FORMAT}"
    if name is None or gate_sharpness is None:
        return "one of vertex_features and vertex_gate_sharpness without the other"
    if name not in RING_FEATURE_SETS:
        return f"vertex_features {name!r}, not one of {', '.join(RING_FEATURE_SETS)}"
    if not (math.isfinite(gate_sharpness) and gate_sharpness > 0):
        return f"vertex_gate_sharpness {gate_sharpness}, not a finite number > 0"
    return None


def _scale_free_problem(card: ModelCard) -> str | None:
    """Return what is wrong with the fields of the scale-free rule, or None."""
    values = {name: getattr(card, name) for name in SCALE_FREE_FIELDS}
    names = (*SCALE_FREE_FIELDS, *OPTIONAL_FIELDS, *CREASE_FIELDS)
    given = [name for name in names if _given(card, name)]
    if card.format < SCALE_FREE_FORMAT:
        return f"{given[0]} in format {card.format}, not {SCALE_FREE_FORMAT}" if given else None
    missing = [name for name in ("vertex_features", *SCALE_FREE_FIELDS) if not _given(card, name)]
    if missing:
        return f"format {card.format} without {missing[0]}"
    levels, _, scale, angle = values.values()
    if not 1 <= levels <= MOST_LEARNED_LEVELS:
        return f"learned_levels {levels}, not 1 … {MOST_LEARNED_LEVELS}"
    if not (math.isfinite(scale) and scale > 0):
        return f"network_scale {scale}, not a finite number > 0"
    for name in STRENGTHS:
        strength = getattr(card, name)
        if strength is not None and not 0 <= strength <= HIGHEST_STRENGTH:
            return f"{name} {strength}, not a number from 0 to {HIGHEST_STRENGTH:g}"
    if card.crease_prior and not card.boundary_strength:
        return "crease_prior without a boundary_strength, which is its strength"
    altitudes = card.network_altitudes
    if altitudes is not None and not (math.isfinite(altitudes) and altitudes > 0):
        return f"network_altitudes {altitudes}, not a finite number > 0"
    if not 0 < angle < 90:
        return f"fold_angle {angle}, not between 0 and 90 degrees"
    if card.crease_angle is not None and not 0 < card.crease_angle < 180:
        return f"crease_angle {card.crease_angle}, not between 0 and 180 degrees"
    if (card.crease_angle is None) != (card.crease_levels is None):
        return "one of crease_angle and crease_levels without the other"
    gentle = card.edged_crease_angle
    if gentle is not None and not 0 < gentle < (card.crease_angle or 0):
        return f"edged_crease_angle {gentle}, not between 0 and crease_angle"
    if card.crease_levels is not None and card.crease_levels < 1:
        return f"crease_levels {card.crease_levels}, not at least 1"
    return None


def _given(card: ModelCard, name: str) -> bool:
    return getattr(card, name) is not None
