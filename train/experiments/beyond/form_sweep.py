"""The numbers on the default model's card, one at a time, its weights held as they are."""

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from pns_common import load_model, loop, pns
from train.data.simplifiers import SIMPLIFIERS, simplified
from train.experiments.beyond.models import models_and_assets
from train.experiments.beyond.real_meshes import LEAST_REDUCTION, dense_files
from train.experiments.harness.experiment import Experiment, Outcome
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.rows import column, table
from train.metrics.decimation import gain
from train.metrics.surface_distance import moved, prepared, surface_errors
from train.refining import Refined, refine

# Symbol, field of the card, values.
SWEPT: tuple[tuple[str, str, tuple[float, ...]], ...] = (
    ("C", "budget", (1, 2, 5, 10, 20, 50)),
    ("s", "prior_strength", (0, 0.5, 0.75, 1, 1.25)),
    ("τ", "network_scale", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
    ("α", "network_altitudes", (1, 2, 3, 5)),
    ("θ", "fold_angle", (30, 45, 60, 75, 85)),
    ("K", "learned_levels", (1, 2, 3)),
)

AS_ON_CARD = ("", 0.0)

SIMPLIFIER, SIZES = "quadric", (500, 2000)
LEVELS = 3
SAMPLES_A_DRAW = 5

NOTE = (
    f"Validation meshes of {' and '.join(map(str, SIZES))} faces (simplifier {SIMPLIFIER}), "
    f"{LEVELS} levels; improvement over Loop on the same mesh, plain mean over meshes. One number "
    "of the card is changed at a time and nothing is trained again, so that s and τ, which "
    "training sees, are at their best where the card has them; C, θ and K act in use alone. "
    "*Guarded*: vertices of the learned levels that the fold guard scales back, in all meshes."
)


@dataclass(frozen=True, slots=True)
class Row:
    """One value of one number, over all meshes."""

    number: str = column("Number")
    value: float = column("Value", "g")
    on_card: bool = column("On the card")
    mean_percent: float = column("Mean %", "+.1f")
    p95_percent: float = column("p95 %", "+.1f")
    largest_percent: float = column("Largest %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    jump: float = column("Jump / Loop's", ".2f")
    guarded: float = column("Guarded %", ".2f")


@dataclass(frozen=True, slots=True)
class Result:
    """One value on one mesh: per cent over Loop, jump over Loop's, vertices of learned levels."""

    gains: dict[str, float]
    jump: float
    guarded: int
    vertices: int


def run(laboratory: Laboratory) -> Outcome:
    """Refine every mesh with every value."""
    assert laboratory.assets is not None  # needs_assets
    scale, samples = laboratory.scale, SAMPLES_A_DRAW * laboratory.scale.samples
    dense = list(islice(dense_files(laboratory.assets / "dense"), scale.instances))
    swept = [(*names, values[: scale.instances]) for *names, values in SWEPT]
    levels = min(LEVELS, scale.levels)
    model = load_model()

    def on_card(field: str, value: float) -> bool:
        return getattr(model.card, field) == value

    # A number as the card has it is the same scheme in every sweep, and measured once.
    keys = {
        (field, value): AS_ON_CARD if on_card(field, value) else (field, value)
        for _, field, values in swept
        for value in values
    }
    schemes = {
        key: pns(replace(model, card=replace(model.card, **{field: value})))
        for (field, value), key in keys.items()
    }
    results: dict[tuple[str, float], list[Result]] = {key: [] for key in schemes}
    for number, original in enumerate(dense):
        laboratory.progress(f"form-sweep: {original.name}", number, len(dense))
        true = prepared(original.mesh, samples)
        for size in SIZES:
            if len(original.mesh.faces) < LEAST_REDUCTION * size:
                continue
            coarse = simplified(original.mesh, SIMPLIFIERS[SIMPLIFIER], size)
            if coarse is None:
                continue
            plain = refine(coarse, loop(), levels)
            loops = prepared(plain.mesh, samples)
            reference = surface_errors(true, loops)
            for key, scheme in schemes.items():
                refined = refine(coarse, scheme, levels)
                errors = surface_errors(true, moved(loops, refined.mesh.vertices))
                results[key].append(_result(gain(reference, errors), refined, plain))
    rows = [
        _row(symbol, value, results[keys[field, value]], on_card=on_card(field, value))
        for symbol, field, values in swept
        for value in values
    ]
    swept_table = table("form_sweep", "One number at a time (validation)", Row, rows)
    return Outcome((swept_table,), notes=(NOTE,))


def _result(gains: dict[str, float], refined: Refined, plain: Refined) -> Result:
    jump, of_loop = (each.report["levels"][-1]["normal_jump_max"] for each in (refined, plain))
    learned = [level for level in refined.report["levels"] if "guarded" in level]
    guarded, vertices = (sum(level[key] for level in learned) for key in ("guarded", "vertices"))
    return Result(gains, jump / of_loop, guarded, vertices)


def _row(symbol: str, value: float, results: list[Result], *, on_card: bool) -> Row:
    def mean_gain(metric: str) -> float:
        return float(np.mean([result.gains[metric] for result in results]))

    return Row(
        number=symbol,
        value=value,
        on_card=on_card,
        mean_percent=mean_gain("mean"),
        p95_percent=mean_gain("p95"),
        largest_percent=mean_gain("hausdorff"),
        normal_percent=mean_gain("normal"),
        jump=float(np.mean([result.jump for result in results])),
        guarded=100 * sum(result.guarded for result in results) / sum(r.vertices for r in results),
    )


EXPERIMENT = Experiment(
    name="form-sweep",
    title="The numbers of the default model's form",
    source="Beyond the paper. On the validation set.",
    run=run,
    seconds=45,
    needs_assets=True,
    reads=models_and_assets,
)
