"""The numbers on the default model's card, one at a time, its weights held as they are."""

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from pns_common.onnx_model import load_model
from pns_common.refine import Refinement, refine
from pns_common.schemes import Scheme, loop, pns
from train.data.dense_meshes import DenseMesh, asset_meshes
from train.data.simplifiers import SIMPLIFIERS, simplified
from train.experiments.beyond.real_meshes import LEAST_REDUCTION, read_files
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.decimation import gain
from train.metrics.surface_distance import prepared, surface_errors

SWEPT: tuple[tuple[str, str, tuple[float, ...]], ...] = (
    ("C", "budget", (1, 2, 5, 10, 20, 50)),
    ("s", "prior_strength", (0, 0.5, 0.75, 1, 1.25)),
    ("τ", "network_scale", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
    ("θ", "fold_angle", (30, 45, 60, 75, 85)),
    ("K", "learned_levels", (1, 2, 3)),
)
"""Symbol, field of the card, values."""

SIMPLIFIER, SIZES = "quadric", (500, 2000)
LEVELS = 3
SAMPLES_A_DRAW = 5
METRICS = ("mean", "p95", "hausdorff", "normal")

COLUMNS = (
    Column("number", "Number"),
    Column("value", "Value", "g"),
    Column("on_card", "On the card"),
    Column("mean_percent", "Mean %", "+.1f"),
    Column("p95_percent", "p95 %", "+.1f"),
    Column("largest_percent", "Largest %", "+.1f"),
    Column("normal_percent", "Normals %", "+.1f"),
    Column("jump", "Jump / Loop's", ".2f"),
    Column("guarded", "Guarded %", ".2f"),
)
NOTE = (
    f"Validation meshes of {' and '.join(map(str, SIZES))} faces (simplifier {SIMPLIFIER}), "
    f"{LEVELS} levels; improvement over Loop on the same mesh, plain mean over meshes. One number "
    "of the card is changed at a time and nothing is trained again, so that s and τ, which "
    "training sees, are at their best where the card has them; C, θ and K act in use alone. "
    "*Guarded*: vertices of the learned levels that the fold guard scales back, in all meshes."
)


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
    files = asset_meshes(laboratory.assets / "dense")
    dense = list(islice((m for m in files if isinstance(m, DenseMesh)), scale.instances))
    swept = [(*names, values[: scale.instances]) for *names, values in SWEPT]
    levels = min(LEVELS, scale.levels)
    results: dict[tuple[str, float], list[Result]] = {}
    for number, original in enumerate(dense):
        laboratory.progress(f"form-sweep: {original.name}", number, len(dense))
        true = prepared(original.mesh, samples)
        for size in SIZES:
            if len(original.mesh.faces) < LEAST_REDUCTION * size:
                continue
            coarse = simplified(original.mesh, SIMPLIFIERS[SIMPLIFIER], size)
            if coarse is None:
                continue
            plain = refine(coarse, loop(), levels, threads=1)
            reference = surface_errors(true, prepared(plain.mesh, samples))
            for symbol, field, values in swept:
                for value in values:
                    refined = refine(coarse, _scheme(field, value), levels, threads=1)
                    errors = surface_errors(true, prepared(refined.mesh, samples))
                    result = _result(gain(reference, errors), refined, plain)
                    results.setdefault((symbol, value), []).append(result)
    rows = [_row(symbol, field, v, results[symbol, v]) for symbol, field, vs in swept for v in vs]
    table = Table("form_sweep", "One number at a time (validation)", COLUMNS, tuple(rows))
    return Outcome((table,), notes=(NOTE,))


def _scheme(field: str, value: float) -> Scheme:
    model = load_model()
    return pns(replace(model, card=replace(model.card, **{field: value})))


def _result(gains: dict[str, float], refined: Refinement, plain: Refinement) -> Result:
    jump, of_loop = (each.report["levels"][-1]["normal_jump_max"] for each in (refined, plain))
    learned = [level for level in refined.report["levels"] if "guarded" in level]
    guarded, vertices = (sum(level[key] for level in learned) for key in ("guarded", "vertices"))
    return Result(gains, jump / of_loop, guarded, vertices)


def _row(symbol: str, field: str, value: float, results: list[Result]) -> tuple[Cell, ...]:
    return (
        symbol,
        value,
        getattr(load_model().card, field) == value,
        *(float(np.mean([result.gains[metric] for result in results])) for metric in METRICS),
        float(np.mean([result.jump for result in results])),
        100 * sum(result.guarded for result in results) / sum(r.vertices for r in results),
    )


EXPERIMENT = Experiment(
    name="form-sweep",
    title="The numbers of the default model's form",
    source="Beyond the paper. On the validation set.",
    run=run,
    seconds=600,
    needs_assets=True,
    reads=read_files,
)
