"""Does the file say what the trained network says? Checked before anything is written."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from pns_common.errors import PnsError
from pns_common.model.features import FEATURE_SETS, Feature
from pns_common.model.session import OnnxModel, networks
from train.models.directed import DirectedNet
from train.models.networks import BoundedNet
from train.models.torch_model import answered, layers_of

# Largest difference allowed, as a fraction of the budget and of the row's largest feature.
#
# Single precision rounds what the layers add up: a sliver whose features are 30 in size rounds 30
# times as much as a triangle, in torch as in the file. Features below 1 count as 1.
TOLERANCE = 3e-6

# Of networks of directed edges, as a fraction of the largest answer.
DIRECTED_TOLERANCE = 3e-6

ROWS = 10_000
BUDGETS = (1e-6, 0.1, 0.5, 1.0, 1e3)


@dataclass(frozen=True, slots=True)
class Parity:
    """The largest difference and the largest length found, as fractions of the budget.

    The difference is divided by the row's largest feature where that is above 1.
    """

    difference: float
    length: float


class ParityError(PnsError):
    """The model file and the network differ; nothing is written."""

    def __init__(self, *, budget: float, difference: float, tolerance: float = TOLERANCE):
        self.budget = budget
        self.difference = difference
        self.tolerance = tolerance
        super().__init__(
            f"the model file and the network differ by {difference:.2e} of the budget {budget:g}, "
            f"more than {tolerance:g}"
        )


def check_parity(model: OnnxModel, network: BoundedNet, tolerance: float = TOLERANCE) -> Parity:
    """Compare the file, run by onnxruntime in float32, with the torch network in float64.

    Against torch's float32 the rounding of torch would count too; it is the larger of the two.

    Raises:
        ParityError: they differ by more than `tolerance` of a budget.
    """
    seen = FEATURE_SETS[model.card.features].features
    features = within(sample_features(len(seen)), seen)
    exact = copy.deepcopy(network).double()
    size = np.maximum(np.abs(features).max(axis=1, keepdims=True), 1)
    largest, longest = 0.0, 0.0
    for budget in BUDGETS:
        with torch.no_grad():
            expected = exact(torch.from_numpy(features).double(), budget).numpy()
        answered = model.run("features", features, budget)
        difference = float((np.abs(answered - expected) / size).max()) / budget
        # Written so that NaN fails it too.
        if not difference <= tolerance:
            raise ParityError(budget=budget, difference=difference, tolerance=tolerance)
        largest = max(largest, difference)
        longest = max(longest, float(np.linalg.norm(answered, axis=1).max()) / budget)
    return Parity(largest, longest)


def within(rows: Float[np.ndarray, "N K"], features: Sequence[Feature]) -> Float[np.ndarray, "N K"]:
    """Return rows cut to the ranges of their features: no mesh has others."""
    limits = np.array([feature.limit for feature in features], dtype=np.float32)
    return np.clip(rows, -limits, limits)


def sample_features(count: int) -> Float[np.ndarray, "N K"]:
    """Return 10,000 seeded feature rows: small and common ones, wide ones, then the extremes.

    The first feature is a curvature in [0, 2], the others are drawn around 0, as signed features
    and logarithms of length ratios are; the extremes hold slivers with ratios of e^±30 and folded
    or exactly planar edges.
    """
    rng = np.random.default_rng(0)
    scale = np.repeat([0.03, 0.3, 3.0, 30.0], ROWS // 4)
    rows = rng.uniform(-1, 1, size=(ROWS, count)) * scale[:, None]
    rows[:, 0] = rng.uniform(0, 2, size=ROWS) ** 2 / 2
    rows[-3:, 0] = [0.0, 1.0, 2.0]
    rows[-3:, 1:] = [[0.0] * (count - 1), [30.0] * (count - 1), [-30.0] * (count - 1)]
    return rows.astype(np.float32)


def check_directed(
    model: OnnxModel, network: DirectedNet, tolerance: float = DIRECTED_TOLERANCE
) -> Parity:
    """Check each network of a file of directed edges on random rows; return what differs most.

    Raises:
        ParityError: an answer differs by more than `tolerance` of the largest one.
    """
    layers, rng, largest = layers_of(network, model.card), np.random.default_rng(0), 0.0
    with torch.no_grad():
        for held in networks(model.card):
            rows = rng.normal(size=(ROWS, held.columns)).astype(np.float32)
            true = answered(layers[held.given], torch.from_numpy(rows)).numpy()
            difference = np.abs(model.run(held.given, rows) - true).max() / np.abs(true).max()
            largest = max(largest, float(difference))
    if not largest <= tolerance:
        raise ParityError(budget=1.0, difference=largest, tolerance=tolerance)
    return Parity(difference=largest, length=0.0)
