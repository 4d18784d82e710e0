"""Does each group of signed features earn its place? Trained with each left out, and each alone."""

from dataclasses import replace

import msgspec

from pns_common.refine import refine
from train.ablations.feature_groups import Choice, features_scheme, fit_features, named
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.paper.methods import PAPER_UNITS
from train.metrics.envelope import envelope_limit
from train.metrics.evaluation import compare_with_loop
from train.models.recipes import Recipe, one_step, paper

SETTINGS = ((0.5, 10.0), (1.0, 100.0))
"""C and c: the paper's, and an envelope in which there is more to gain."""

SHOWN = ("distance_near", "distance", "hausdorff", "normal_near", "normal")
COLUMNS = (
    Column("budget", "C", "g"),
    Column("gate_sharpness", "c", "g"),
    Column("features", "Features"),
    Column("count", "Number"),
    Column("near_percent", "Near %", "+.2f"),
    Column("global_percent", "All %", "+.2f"),
    Column("hausdorff_percent", "Hausdorff %", "+.2f"),
    Column("normal_near_percent", "Normals near %", "+.2f"),
    Column("normal_percent", "Normals %", "+.2f"),
    Column("max_ratio", "Max ratio", ".4f"),
)
NOTES = (
    "Improvements over Loop on the held-out ridges, all trained by the recipe `paper` with the "
    "orientation `symmetric`; docs/features.md defines the features. *Limit* is the best that any "
    "network could do with the same C and c; there is none for normals.",
    "The paper has no such table: its five features have no sign.",
)


def setting(budget: float, gate_sharpness: float) -> Recipe:
    """Return the default recipe, symmetric, with another C and c."""
    name = f"features-C{budget:g}-c{gate_sharpness:g}"
    base = paper()
    return replace(
        base,
        name=name,
        budget=budget,
        gate_sharpness=gate_sharpness,
        orientation="symmetric",
        training=msgspec.structs.replace(one_step(base), quiet=0.0),
    )


def run(laboratory: Laboratory) -> Outcome:
    """Train each choice of features in both settings."""
    rows = []
    for budget, gate_sharpness in SETTINGS:
        recipe = setting(budget, gate_sharpness)
        recipe = replace(recipe, steps=min(recipe.steps, laboratory.scale.training_steps))
        rows += [_row(laboratory, recipe, choice) for choice in named()]
        limit = envelope_limit(laboratory.dataset("ridge-held-out"), budget, gate_sharpness)
        best = [limit[metric].percent if metric in limit else None for metric in SHOWN]
        rows.append((budget, gate_sharpness, "*limit*", None, *best, None))
    table = Table("features", "Feature groups left out, and added", COLUMNS, tuple(rows))
    return Outcome((table,), notes=NOTES)


def _row(laboratory: Laboratory, recipe: Recipe, choice: Choice) -> tuple[Cell, ...]:
    def on_step(done: int, _: float) -> None:
        laboratory.progress(f"training {choice.title}", done, recipe.steps)

    held_out = laboratory.dataset("ridge-held-out")
    network = fit_features(recipe, choice.features, on_step)
    scheme = features_scheme(recipe, choice.features, network)
    improvements = compare_with_loop(scheme, held_out)
    ratio = max(
        refine(instance.mesh, scheme, reference_length=PAPER_UNITS).ratio.max()
        for instance in held_out.instances
    )
    percents = [improvements[metric].percent for metric in SHOWN]
    count = choice.features.count
    return recipe.budget, recipe.gate_sharpness, choice.title, count, *percents, float(ratio)


EXPERIMENT = Experiment(
    name="features",
    title="Signed features",
    source="Beyond the paper.",
    run=run,
    seconds=600,
)
