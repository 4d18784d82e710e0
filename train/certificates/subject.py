"""Subjects of certification, as they run and in double precision, and their certificates."""

import copy
import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

from torch import nn

from pns_common import Scheme, pns
from pns_common.model.card import PAPER_FORMAT, ModelCard
from pns_common.model.session import Model
from train.certificates.bases import CATMULL_CLARK, LOOP, Base
from train.models.torch_model import TorchModel

Trained = TypeVar("Trained", bound=nn.Module)

# A budget that no correction reaches.
UNBOUNDED = 1e15

# From 1, in `in_words`.
NEAR = 1e-5


@dataclass(frozen=True, eq=False)
class Subject:
    """A scheme under certification.

    Attributes:
        name: for reports.
        scheme: the scheme as the product runs it.
        exact: the same with its network in double precision; `scheme` itself where there is no
            network or it is double already. Slopes and spectra need it: the noise of a single
            precision network drowns small differences.
        budget: C of the envelope C h² / R that the scheme is held to.
        card: the model's; None without a model.
        unbounded: `exact` with a budget that nothing reaches; itself without a model.
    """

    name: str
    scheme: Scheme
    exact: Scheme
    budget: float
    card: ModelCard | None = None
    unbounded: Scheme | None = None

    @property
    def is_single_precision(self) -> bool:
        """True where the network runs in single precision."""
        return self.exact is not self.scheme

    @property
    def base(self) -> Base:
        """The base scheme; Loop without a model."""
        polygons = self.card is not None and self.card.base == CATMULL_CLARK.scheme.name
        return CATMULL_CLARK if polygons else LOOP

    @property
    def learned_once(self) -> ModelCard | None:
        """The card of a scheme that corrects the control mesh alone: then it is its base."""
        card = self.card
        return card if card is not None and card.format != PAPER_FORMAT else None

    @property
    def moves_curves(self) -> bool:
        """True where boundaries and creases have a rule of their own."""
        card = self.learned_once
        return card is not None and bool(card.boundary_strength)


def subject_of_model(model: Model, exact: Model, budget: float | None = None) -> Subject:
    """Return the learned operator with a model, and with the same model in double precision."""
    scheme = pns(model, budget)
    return Subject(
        model.name,
        scheme,
        pns(exact, budget),
        float(scheme.budget or 0.0),
        model.card,
        pns(exact, UNBOUNDED),
    )


def subject_of_network(model: TorchModel, budget: float | None = None) -> Subject:
    """Return the learned operator with a torch network."""
    exact = TorchModel(model.name, model.card, in_double(model.network))
    return subject_of_model(model, exact, budget)


def in_double(network: Trained) -> Trained:
    """Return a copy of a network in double precision."""
    return copy.deepcopy(network).double()


class Kind(StrEnum):
    """The meaning of a failure."""

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
        """True where the value is in its range."""
        return self.low <= self.value <= self.high

    @property
    def counts(self) -> bool:
        """True where failing it is failing: of all but diagnostics."""
        return self.kind is not Kind.DIAGNOSTIC

    @property
    def bound(self) -> str:
        """The range in words."""
        if self.low == self.high:
            return f"= {self.high:g}"
        if math.isinf(self.low):
            return "any" if math.isinf(self.high) else f"≤ {in_words(self.high)}"
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


def in_words(value: float) -> str:
    """Return a number in six digits; beside 1 with its distance, which they would round away."""
    if 0 < abs(value - 1) < NEAR:
        return f"1 {'+' if value > 1 else '−'} {abs(value - 1):.2g}"
    return f"{value:.6g}"
