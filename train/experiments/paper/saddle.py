"""The saddle null result: a smooth surface that Loop fits already."""

from dataclasses import dataclass

import numpy as np

from pns_common import Scheme
from train.data.datasets import Dataset
from train.experiments.harness.comparison import LIMIT_NOTE, Comparison, comparison_rows
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.paper.methods import PAPER_UNITS, saddle
from train.experiments.paper.paper_values import PUBLISHED_SADDLE
from train.metrics.card import compare_with_loop
from train.metrics.envelope import envelope_limit
from train.models.recipes import paper
from train.refining import refine

NOTES = (
    LIMIT_NOTE,
    "The gate stays close to zero on saddles, and Loop's own error there is small beside that on "
    "ridges. Trained on saddles, the network learns to leave them alone, as in the paper. The "
    "network of the ridges, which knows nothing of saddles, spends what little the gate lets "
    "through in the wrong direction: large in per cent, small in length. The limit shows that a "
    "network could gain here. *Near* means within 0.3 of the saddle point in the plane.",
    "The published near-feature normal error of saddles does not come out of the published weights "
    "(see `published`). Its angles are so small that a cosine in float32, which resolves steps of "
    "3.5e-4 radians near 1, cannot tell them apart: the published number is rounding.",
)


@dataclass(frozen=True, slots=True)
class GateRow:
    """The opening of the gate on one data set."""

    dataset: str = column("Data")
    mean_gate: float = column("Mean gate", ".4f")
    max_gate: float = column("Max gate", ".4f")
    share_active: float = column("Gate above 0.01", ".1%")


def gate_row(scheme: Scheme, dataset: Dataset) -> GateRow:
    """Return mean, maximum and active share of the gate over a data set's inserted vertices."""
    gates = np.concatenate(
        [
            refine(instance.mesh, scheme, 1, reference_length=PAPER_UNITS).gate[
                len(instance.mesh.vertices) :
            ]
            for instance in dataset.instances
        ]
    )
    return GateRow(
        dataset=dataset.name,
        mean_gate=float(gates.mean()),
        max_gate=float(gates.max()),
        share_active=float((gates > 0.01).mean()),
    )


def run(laboratory: Laboratory) -> Outcome:
    """Train on saddles, and also take the network of the ridges there."""
    held_out, ridges = laboratory.dataset("saddle-held-out"), laboratory.dataset("ridge-held-out")
    recipe = saddle()
    scheme = laboratory.scheme(recipe)
    limit = envelope_limit(held_out, recipe.budget, recipe.gate_sharpness)
    rows = [
        *comparison_rows(
            "PNS trained on saddles",
            held_out.name,
            compare_with_loop(scheme, held_out),
            limit=limit,
            published=PUBLISHED_SADDLE,
        ),
        *comparison_rows(
            "PNS trained on ridges",
            held_out.name,
            compare_with_loop(laboratory.scheme(paper()), held_out),
            limit=limit,
        ),
    ]
    opened = (gate_row(scheme, held_out), gate_row(scheme, ridges))
    gates = table("saddle_gate", "How far the gate opens", GateRow, opened)
    return Outcome((table("saddle", "One step on saddles", Comparison, rows), gates), (), NOTES)


EXPERIMENT = Experiment(
    name="saddle",
    title="Saddles: a null result",
    source="Paper: Capacity sweep and budget localisation, last paragraph.",
    run=run,
    seconds=10,
)
