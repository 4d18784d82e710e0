"""What a certificate says: one property, its number, the range that the number must be in."""

import math
from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """What a failure means."""

    CERTIFICATE = "certificate"  # a theorem does not hold
    MEASURED = "measured"  # a theorem's conclusion was not seen; no theorem bounds the number
    DIAGNOSTIC = "diagnostic"  # nothing is promised: the number is for comparison


@dataclass(frozen=True, slots=True)
class Certificate:
    """One property of one subject.

    Attributes:
        theorem: "T1" … "T8" of the paper, or "file" and "stars" beside them.
        name: the property, in words.
        value: its number; NaN where nothing could be measured, and NaN fails.
        low, high: the range of values that pass; −∞ and ∞ where it is open.
        where: the mesh (and element) of the worst value, or why there is none.
    """

    theorem: str
    name: str
    value: float
    low: float = -math.inf
    high: float = math.inf
    where: str = ""
    kind: Kind = Kind.CERTIFICATE

    @property
    def passed(self) -> bool:
        """Whether the value is in its range."""
        return self.low <= self.value <= self.high

    @property
    def counts(self) -> bool:
        """Whether failing it is failing: true of all but diagnostics."""
        return self.kind is not Kind.DIAGNOSTIC

    @property
    def bound(self) -> str:
        """The range in words."""
        if self.low == self.high:
            return f"= {self.high:g}"
        if math.isinf(self.low):
            return "any" if math.isinf(self.high) else f"≤ {_short(self.high)}"
        if math.isinf(self.high):
            return f"≥ {self.low:g}"
        return f"{self.low:g} … {self.high:g}"


def worst(measured: list[tuple[float, str]]) -> tuple[float, str]:
    """Return the largest value with its place; a NaN is worse than any number."""
    return max(measured, key=lambda entry: math.inf if math.isnan(entry[0]) else entry[0])


def farthest(measured: list[tuple[float, str]], expected: float) -> tuple[float, str]:
    """Return the value farthest from the expected one, and its place; a NaN is farthest."""
    return max(
        measured, key=lambda entry: math.inf if math.isnan(entry[0]) else abs(entry[0] - expected)
    )


def _short(value: float) -> str:
    # A bound of 1 + rounding is shown as what it means.
    return "1" if 0 < value - 1 < 1e-9 else f"{value:g}"
