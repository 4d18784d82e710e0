"""What a request may ask for, and what it may cost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from service.errors import InvalidParameter

MAX_LEVELS = 6

SCHEMES = ("pns", "loop")
DIAGNOSTICS = ("summary", "full", "none")


@dataclass(frozen=True, slots=True)
class Options:
    """One request's parameters, valid once constructed.

    `budget` is the dimensionless C (None: the model's own); `reference_length` is a length in the
    mesh's local coordinates, or "auto". Raises InvalidParameter.
    """

    levels: int = 1
    scheme: Literal["pns", "loop"] = "pns"
    budget: float | None = None
    reference_length: float | Literal["auto"] = "auto"
    diagnostics: Literal["summary", "full", "none"] = "summary"

    def __post_init__(self) -> None:
        if not 1 <= self.levels <= MAX_LEVELS:
            raise InvalidParameter(
                "levels", f"levels is {self.levels}; it must be 1 to {MAX_LEVELS}"
            )
        if self.scheme not in SCHEMES:
            raise InvalidParameter("scheme", f"scheme must be one of {', '.join(SCHEMES)}")
        if self.diagnostics not in DIAGNOSTICS:
            raise InvalidParameter(
                "diagnostics", f"diagnostics must be one of {', '.join(DIAGNOSTICS)}"
            )
        if self.budget is not None and not (math.isfinite(self.budget) and self.budget >= 0):
            raise InvalidParameter("budget", "budget must be a finite number, zero or more")
        if self.reference_length != "auto" and not (
            math.isfinite(self.reference_length) and self.reference_length > 0
        ):
            raise InvalidParameter(
                "reference_length", "reference_length must be 'auto' or a finite positive number"
            )


@dataclass(frozen=True, slots=True)
class Limits:
    """What one job may cost; checked against predictions, before the memory is allocated.

    Bytes for `max_memory_bytes`; counts for the others. `max_json_items` bounds the characters that
    open or separate values in the JSON text, `max_json_depth` how deep it nests.
    """

    max_faces: int = 5_000_000
    max_memory_bytes: int = 4 * 1024**3
    max_json_items: int = 2_000_000
    max_json_depth: int = 128
