"""The model card: what a model file says of itself, as JSON in its metadata.

Format 1 is the paper's operator: one network for edges, at every level. Format 5 is the default's:
networks of directed edges and a fold guard, at level 0 alone. Formats 2 to 4 are not read any more.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from types import MappingProxyType, NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from pns_common.model.features import DIRECTED_28, FEATURE_SETS

# The metadata key of an ONNX file that holds the card.
CARD_KEY = "pns_card"
PAPER_FORMAT, DIRECTED_FORMAT = 1, 5
RETIRED_FORMATS = (2, 3, 4)

DIRECTED_FEATURES: Mapping[str, int] = MappingProxyType({DIRECTED_28.name: DIRECTED_28.count})
# How many columns each feature set has.
EDGE_FEATURES: Mapping[str, int] = MappingProxyType(
    {name: seen.count for name, seen in FEATURE_SETS.items()}
)
ORIENTATIONS = ("first-face", "symmetric")
BASES = ("loop", "catmull-clark")
# Along a curve 1 is full quasi-interpolation; far beyond it squares leave the floats.
HIGHEST_STRENGTH = 100.0
MOST_SHARPNESS_LEVELS = 16


@dataclass(frozen=True)
class ModelCard:
    """Card of a model file. Fields after ``metrics`` belong to format 5 alone.

    Attributes:
        format: Version of the file format, 1 or 5.
        features: Name of the feature set that the first network reads.
        gate_sharpness: c of the edge gate γ = tanh(c x²).
        budget: C that the model was trained at, and the default.
        orientation: How (a, b, c, d) are ordered: "first-face" or "symmetric".
        training: Recipe, seed and everything else that fixes the training; no dates.
        metrics: Measured on held-out data.
        base: Base scheme, "loop" or "catmull-clark".
        vertex_gate_sharpness: c_v of the vertex gate γ_v = tanh(c_v x_v).
        boundary_strength: Strength of the prior along boundary and crease curves, 0 … 100.
        network_scale: τ, the longest vector that the network may ask for, in edge lengths.
        fold_angle: θ of the fold guard, between 0 and 90 degrees.
        sharpness_levels: At how many levels sharp edges stay sharp, 0 … 16.
        width: W, how many numbers the state of a directed edge has.
        hidden: H, how many numbers the hidden layer of a round has.
        rounds: How many rounds of messages these exchange.
    """

    format: int
    features: str
    gate_sharpness: float
    budget: float
    orientation: str
    training: dict[str, Any]
    metrics: dict[str, Any]
    base: str | None = None
    vertex_gate_sharpness: float | None = None
    boundary_strength: float | None = None
    network_scale: float | None = None
    fold_angle: float | None = None
    sharpness_levels: int | None = None
    width: int | None = None
    hidden: int | None = None
    rounds: int | None = None

    def to_json(self) -> str:
        """Return the card as JSON, keys in the order of the attributes, without fields of None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        given = {name: value for name, value in values.items() if value is not None}
        return json.dumps(given, separators=(",", ":"), ensure_ascii=False, allow_nan=False)

    @staticmethod
    def from_json(text: str) -> ModelCard:
        """Read a card.

        Raises:
            ValueError: it is not JSON, its format is retired or unknown, a field is missing,
                unknown or of the wrong type, or a value is outside its range.
        """
        values = _json_object(text)
        _check_format(values.get("format"))
        card = ModelCard(**_typed_fields(values))
        _check_fields_of_format(card)
        for name, (accepts, expected) in _RANGES.items():
            value = getattr(card, name)
            if value is not None and not accepts(value):
                raise ValueError(f"{name} {value!r}, not {expected}")
        return card


_OPTIONAL = frozenset(field.name for field in fields(ModelCard) if field.default is None)
# Beside the fields without a default: what a card of a format has.
NEEDED: Mapping[int, frozenset[str]] = MappingProxyType(
    {PAPER_FORMAT: frozenset[str](), DIRECTED_FORMAT: _OPTIONAL}
)

Range = tuple[Callable[[Any], bool], str]


def _one_of(names: tuple[str, ...] | Mapping[str, int]) -> Range:
    return names.__contains__, f"one of {', '.join(names)}"


_POSITIVE: Range = (lambda value: math.isfinite(value) and value > 0, "a finite number > 0")
_STRENGTH: Range = (
    lambda value: 0 <= value <= HIGHEST_STRENGTH,
    f"a number from 0 to {HIGHEST_STRENGTH:g}",
)
_RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "features": _one_of({**EDGE_FEATURES, **DIRECTED_FEATURES}),
        "gate_sharpness": _POSITIVE,
        "budget": _POSITIVE,
        "orientation": _one_of(ORIENTATIONS),
        "base": _one_of(BASES),
        "vertex_gate_sharpness": _POSITIVE,
        "boundary_strength": _STRENGTH,
        "network_scale": _POSITIVE,
        "fold_angle": (lambda value: 0 < value < 90, "between 0 and 90 degrees"),
        "sharpness_levels": (
            lambda value: 0 <= value <= MOST_SHARPNESS_LEVELS,
            f"from 0 to {MOST_SHARPNESS_LEVELS}",
        ),
        "width": (lambda value: 2 <= value <= 128 and value % 2 == 0, "even, from 2 to 128"),
        "hidden": (lambda value: 2 <= value <= 512 and value % 2 == 0, "even, from 2 to 512"),
        "rounds": (lambda value: 1 <= value <= 8, "from 1 to 8"),
    }
)


def _json_object(text: str) -> dict[str, Any]:
    """Read the object that a text of JSON holds. Raises ValueError."""

    def refuse(word: str) -> None:
        raise ValueError(f"{word}, which is no number of JSON")

    try:
        value: Any = json.loads(text, parse_constant=refuse)
    except RecursionError as error:
        raise ValueError("nested too deep") from error
    match value:
        case dict():
            return dict(value)  # pyright: ignore[reportUnknownArgumentType]
        case _:
            raise ValueError(f"{type(value).__name__}, not an object")


def _check_format(version: object) -> None:
    """Check the format before all else. Raises ValueError."""
    if version in RETIRED_FORMATS:
        raise ValueError(f"format {version}, which is not read any more: train and export it anew")
    if version not in NEEDED:
        raise ValueError(f"format {version}")


def _typed_fields(values: dict[str, Any]) -> dict[str, Any]:
    """Return a card's fields, each of its type."""
    known = {field.name: field for field in fields(ModelCard)}
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise ValueError(f"unknown fields {', '.join(unknown)}")
    missing = [n for n, f in known.items() if f.default is MISSING and n not in values]
    if missing:
        raise ValueError(f"missing fields {', '.join(missing)}")
    hints = get_type_hints(ModelCard)
    return {name: _typed(name, value, _kinds(hints[name])) for name, value in values.items()}


def _typed(name: str, value: Any, kinds: tuple[Any, ...]) -> Any:
    """Return a field's value, an integer as a float where that is its type."""
    accepted = (*kinds, int) if float in kinds else kinds
    # true and false are integers to Python, and no field is one of them.
    if isinstance(value, bool) or not isinstance(value, accepted):
        raise ValueError(f"{name} of type {type(value).__name__}")  # noqa: TRY004
    if float not in kinds:
        return value
    try:
        return float(value)
    except OverflowError as error:
        raise ValueError(f"{name} with more digits than a float holds") from error


def _kinds(hint: Any) -> tuple[Any, ...]:
    """Return the types that a hint allows beside None, containers without their items."""
    kinds = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return tuple(get_origin(kind) or kind for kind in kinds if kind is not NoneType)


def _check_fields_of_format(card: ModelCard) -> None:
    """Check that the fields of its format stand there and no others. Raises ValueError."""
    given = {field.name for field in fields(card) if getattr(card, field.name) is not None}
    needed = NEEDED[card.format]
    for name in sorted(given & _OPTIONAL - needed):
        raise ValueError(f"unknown field {name} in format {card.format}")
    for name in sorted(needed - given):
        raise ValueError(f"missing field {name} in format {card.format}")
    if (card.features in DIRECTED_FEATURES) != (card.format == DIRECTED_FORMAT):
        raise ValueError(f"features {card.features!r} in format {card.format}")
