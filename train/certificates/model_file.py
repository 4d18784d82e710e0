"""Does a model file keep its word? Finite corrections, within the budget, as good as its card says.

The operator projects and checks whatever a network returns, so no theorem hangs on this; but a file
that breaks its contract, or claims what it does not reach, is not to be trusted.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from pns_common import pns
from pns_common.model.card import DIRECTED_FORMAT
from pns_common.model.session import Model, Network, networks
from train.certificates.subject import Certificate
from train.metrics.card import MEASURES

BUDGETS = (1e-6, 0.1, 0.5, 1.0, 1e3)
SINGLE_PRECISION = 1 + 1e-6
SAMPLES = 4096
# Features of directed edges are turns, and lengths that level off at 3.
WIDEST = math.pi

# Percentage points between a card's improvement and the measured one: rounding on another
# machine, no more.
POINTS = 0.05


def keeps_its_word(model: Model) -> list[Certificate]:
    """Certify a model's answers at sample features and its card's metrics."""
    held = networks(model.card)
    if model.card.format == DIRECTED_FORMAT:
        return [*(_finite(model, network) for network in held), _metrics(model)]
    return [*_bounded(model, held[0]), _metrics(model)]


def sample_features(count: int) -> Float[np.ndarray, "N K"]:
    """Draw rows as meshes give them, then wide ones, slivers (e^±30), flat and folded edges."""
    rng = np.random.default_rng(0)
    width = 10.0 ** rng.uniform(-1, 1.5, size=(SAMPLES, 1))
    rows = width * rng.uniform(-1, 1, size=(SAMPLES, count))
    rows[:, 0] = rng.uniform(0, 2, SAMPLES)
    extremes = [(x, side) for x in (0.0, 2.0) for side in (-350.0, -30.0, 0.0, 30.0, 350.0)]
    rows[-len(extremes) :] = [[x, *[side] * (count - 1)] for x, side in extremes]
    return rows


def _finite(model: Model, network: Network) -> Certificate:
    """Certify one network of directed edges: its rows are bounded, and so is no answer's length."""
    rows = np.random.default_rng(0).uniform(-WIDEST, WIDEST, (SAMPLES, network.columns))
    answers = model.run(network.given, rows)
    wrong = int((~np.isfinite(answers).all(axis=1)).sum())
    return Certificate("file", f"finite {network.answer}", wrong, 0, 0, f"of {SAMPLES} rows")


def _bounded(model: Model, network: Network) -> list[Certificate]:
    """Certify the network of the paper's rule: finite corrections, within the budget."""
    features = sample_features(network.columns)
    not_finite, longest, budget_of_longest = 0, 0.0, BUDGETS[0]
    for budget in BUDGETS:
        answers = np.asarray(model.run(network.given, features, budget), dtype=np.float64)
        finite = np.isfinite(answers).all(axis=1)
        not_finite += int((~finite).sum())
        share = np.linalg.norm(answers[finite], axis=1).max(initial=0) / budget
        longest, budget_of_longest = max((longest, budget_of_longest), (float(share), budget))
    return [
        Certificate(
            "file",
            "finite corrections",
            not_finite,
            0,
            0,
            f"of {len(BUDGETS) * len(features)} rows",
        ),
        Certificate(
            "file",
            "corrections within the budget given",
            longest,
            high=SINGLE_PRECISION,
            where=f"budget {budget_of_longest:g}",
        ),
    ]


def _metrics(model: Model) -> Certificate:
    name, unknown = "the card's metrics come out again", []
    worst, where = 0.0, "no metrics on the card"
    for dataset, claimed in model.card.metrics.items():
        if dataset not in MEASURES:
            unknown.append(dataset)
            continue
        measured = MEASURES[dataset](pns(model))
        for metric, row in measured.items():
            off = abs(_claimed_percent(claimed, metric) - row.percent)
            if not off <= worst:
                worst, where = off, f"{dataset}, {metric}: measured {row.percent:+.2f} %"
    if unknown:
        where += f"; not known here: {', '.join(unknown)}"
    return Certificate("file", name, worst, high=POINTS, where=where)


def _claimed_percent(claimed: Any, metric: str) -> float:
    """Return what a card says of a metric; NaN, which fails, where it says nothing readable."""
    row = claimed.get(metric) if isinstance(claimed, Mapping) else None
    value = row.get("percent") if isinstance(row, Mapping) else None
    return float(value) if isinstance(value, int | float) else math.nan
