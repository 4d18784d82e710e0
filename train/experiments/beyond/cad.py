"""Patches of computer-aided design with a closed form: a fillet, a torus, a rounded box."""

from train.data.datasets import Dataset
from train.data.patches import fillets, rounded_boxes, tori
from train.experiments.harness.comparison import LIMIT_NOTE, Comparison, comparison_rows
from train.experiments.harness.experiment import Experiment, Outcome, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.card import compare_with_loop
from train.metrics.envelope import envelope_limit
from train.models.recipes import paper

NOTES = (
    LIMIT_NOTE,
    "**Where this differs from the paper.** The paper expects the ridges' regime on such patches, "
    "since the operator responds to curvature alone. That holds for convex edges (the rounded "
    "box). On the fillet, a concave edge, the ridges' network makes things worse: its five "
    "features know how much an edge bends but not which way, so it pushes outwards there too. The "
    "limit shows that the envelope is not to blame. Nothing was trained on these patches.",
)


def run(laboratory: Laboratory) -> Outcome:
    """Measure the default network on the three families."""
    recipe = paper()
    scheme = laboratory.scheme(recipe)
    rows: list[Comparison] = []
    for family in (fillets(), tori(), rounded_boxes()):
        data = Dataset(family.name, family.instances[: laboratory.scale.instances])
        limit = envelope_limit(data, recipe.budget, recipe.gate_sharpness)
        improvements = compare_with_loop(scheme, data)
        rows += comparison_rows("PNS trained on ridges", data.name, improvements, limit=limit)
    return Outcome((table("cad", "One step on CAD patches", Comparison, rows),), notes=NOTES)


EXPERIMENT = Experiment(
    name="cad",
    title="CAD patches with a closed form",
    source="Beyond the paper, which names them as open (Implementation and scope).",
    run=run,
    seconds=5,
)
