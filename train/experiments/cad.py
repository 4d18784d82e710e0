"""Patches of computer-aided design with a closed form: a fillet, a torus, a rounded box."""

from train.cad_patches import fillets, rounded_boxes, tori
from train.datasets import Dataset
from train.envelope import envelope_limit
from train.evaluation import compare_with_loop
from train.experiments.comparison import COLUMNS, LIMIT_NOTE, comparison_rows
from train.experiments.experiment import Cell, Experiment, Outcome, Table
from train.experiments.laboratory import Laboratory
from train.recipes import ridge

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
    recipe = ridge()
    scheme = laboratory.scheme(recipe)
    rows: list[tuple[Cell, ...]] = []
    for family in (fillets(), tori(), rounded_boxes()):
        data = Dataset(family.name, family.instances[: laboratory.scale.instances])
        limit = envelope_limit(data, recipe.budget, recipe.gate_sharpness)
        found = compare_with_loop(scheme, data)
        rows += comparison_rows("PNS trained on ridges", data.name, found, limit=limit)
    return Outcome((Table("cad", "One step on CAD patches", COLUMNS, tuple(rows)),), notes=NOTES)


EXPERIMENT = Experiment(
    name="cad",
    title="CAD patches with a closed form",
    source="Beyond the paper, which names them as open (Implementation and scope).",
    run=run,
    seconds=5,
)
