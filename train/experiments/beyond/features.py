"""Does each group of signed features earn its place? Trained with each left out, and each alone."""

from dataclasses import dataclass, replace

import msgspec

from train.ablations.feature_groups import Choice, choices, features_method, fit_features
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.paper.methods import largest_ratio
from train.metrics.card import compare_with_loop
from train.metrics.envelope import envelope_limit
from train.models.recipe import Recipe, one_step
from train.models.recipes import paper

# C and c: the paper's, and an envelope in which there is more to gain.
SETTINGS = ((0.5, 10.0), (1.0, 100.0))

NOTES = (
    "Improvements over Loop on the held-out ridges, all trained by the recipe `paper` with the "
    "orientation `symmetric`; docs/reference/features.md defines the features. *Limit* is the "
    "best that any network could do with the same C and c; there is none for normals.",
    "The paper has no such table: its five features have no sign.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One choice of features in one setting, or the setting's limit."""

    budget: float = column("C", "g")
    gate_sharpness: float = column("c", "g")
    features: str = column("Features")
    count: int | None = column("Number")
    near_percent: float = column("Near %", "+.2f")
    global_percent: float = column("All %", "+.2f")
    hausdorff_percent: float = column("Hausdorff %", "+.2f")
    normal_near_percent: float | None = column("Normals near %", "+.2f")
    normal_percent: float | None = column("Normals %", "+.2f")
    max_ratio: float | None = column("Max ratio", ".4f")


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
        rows += [_row(laboratory, recipe, choice) for choice in choices()]
        limit = envelope_limit(laboratory.dataset("ridge-held-out"), budget, gate_sharpness)
        rows.append(
            Row(
                budget=budget,
                gate_sharpness=gate_sharpness,
                features="*limit*",
                count=None,
                near_percent=limit["distance_near"].percent,
                global_percent=limit["distance"].percent,
                hausdorff_percent=limit["hausdorff"].percent,
                normal_near_percent=None,
                normal_percent=None,
                max_ratio=None,
            )
        )
    tried = table("features", "Feature groups left out, and added", Row, rows)
    return Outcome((tried,), notes=NOTES)


def _row(laboratory: Laboratory, recipe: Recipe, choice: Choice) -> Row:
    def on_step(done: int, _: float) -> None:
        laboratory.progress(f"training {choice.title}", done, recipe.steps)

    held_out = laboratory.dataset("ridge-held-out")
    network = fit_features(recipe, choice, on_step)
    scheme = features_method(recipe, choice, network)
    improvements = compare_with_loop(scheme, held_out)
    return Row(
        budget=recipe.budget,
        gate_sharpness=recipe.gate_sharpness,
        features=choice.title,
        count=len(choice.features),
        near_percent=improvements["distance_near"].percent,
        global_percent=improvements["distance"].percent,
        hausdorff_percent=improvements["hausdorff"].percent,
        normal_near_percent=improvements["normal_near"].percent,
        normal_percent=improvements["normal"].percent,
        max_ratio=largest_ratio(scheme, held_out),
    )


EXPERIMENT = Experiment(
    name="features",
    title="Signed features",
    source="Beyond the paper.",
    run=run,
    seconds=140,
)
