"""A tied network as a model calls it: opened from a file's bytes, answering rows of features."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32

from pns_common.errors import ModelError
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.ring_features import RING_FEATURE_SETS
from pns_common.features.symmetry import Symmetries
from pns_common.fused import kernels_loaded
from pns_common.models.card import ModelCard
from pns_common.models.contract import answer_to
from pns_common.models.tied_form import TiedForm, tied_form
from pns_common.runtimes.numpy_network import NumpyNetwork, open_network
from pns_common.runtimes.tied_network.arrays import answers_of
from pns_common.runtimes.tied_network.perceptron import read_perceptron

# Larger files are other networks; reading them here would be for nothing.
LARGEST_FILE = 2**20


@dataclass(frozen=True, eq=False)
class TiedNetwork:
    """The networks of a file by the input that each reads."""

    forms: Mapping[str, TiedForm]

    def answers(
        self, given: str, features: Float[np.ndarray, "N K"], budget: float
    ) -> Float32[np.ndarray, "N 3"]:
        """Return what the network that reads ``given`` answers.

        Raises:
            ValueError: it reads rows of another length.
        """
        form = self.forms[given]
        rows = np.ascontiguousarray(features, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(form.characters):
            raise ValueError(f"{given} of shape {rows.shape}")
        if not kernels_loaded():
            return answers_of(form, rows, budget)
        # Not before the kernels are there: importing it would load them.
        from pns_common.fused.learned import tied_network

        return tied_network.answers_of(form, rows, budget)


def open_tied_network(data: bytes, name: str) -> tuple[ModelCard, TiedNetwork] | None:
    """Open a file all of whose networks are tied; None for any other, and for what is no model."""
    if len(data) > LARGEST_FILE:
        return None
    try:
        card, graph = open_network(data, name)
    except ModelError:
        return None
    forms = {given: _form(graph, given, group) for given, group in _groups(card).items()}
    known = {given: form for given, form in forms.items() if form is not None}
    return (card, TiedNetwork(known)) if len(known) == len(forms) else None


def _groups(card: ModelCard) -> dict[str, Symmetries]:
    """Return the symmetries of what each input reads."""
    groups = {"features": FEATURE_SETS[card.features].symmetries}
    if card.vertex_features is not None:
        groups["vertex_features"] = RING_FEATURE_SETS[card.vertex_features].symmetries
    return groups


def _form(graph: NumpyNetwork, given: str, group: Symmetries) -> TiedForm | None:
    layers = read_perceptron(graph, given, answer_to(given))
    return None if layers is None else tied_form(layers, group)
