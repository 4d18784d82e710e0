"""Ridges and other families that no recipe has seen, after four levels, beside the controls."""

import numpy as np

from pns_common.schemes import Scheme
from train.data.datasets import Dataset, draw_ridges
from train.data.family_sets import held_out_families, trained_families
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, contenders
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.whole_surface import WholeSurface, whole_surface

SEED, COUNT = 271_828, 10
COLUMNS = (
    Column("family", "Family"),
    Column("method", "Method"),
    Column("distance_percent", "RMSE %", "+.1f"),
    Column("largest_percent", "Largest %", "+.1f"),
    Column("normal_percent", "Normals %", "+.1f"),
    Column("jump", "Jump / Loop's", ".2f"),
    Column("worst_percent", "Worst instance %", "+.1f"),
    Column("worst_normal_percent", "Worst in normals %", "+.1f"),
)
NOTE = (
    "Ten new draws of the paper's ridges (on its patches, reference length 1), and the other "
    "families' test sets, all vertices and faces after the last level. Improvements are ratios of "
    "means over the instances; the worst instance is the one that gains least. The jump is the "
    "largest angle between neighbouring faces, mean over instances of the ratio to Loop's."
)


def run(laboratory: Laboratory) -> Outcome:
    """Measure all families."""
    scale = laboratory.scale
    ridges = Dataset("fresh-ridges", draw_ridges(seed=SEED, count=COUNT))
    families = [ridges, *trained_families(), *held_out_families()]
    rows: list[tuple[Cell, ...]] = []
    for number, family in enumerate(families[: scale.instances]):
        laboratory.progress(f"fresh-ridges: {family.name}", number, len(families))
        data = Dataset(family.name, family.instances[: scale.instances])
        rows += _rows(data, contenders(), scale.levels)
    return Outcome(
        (Table("fresh_ridges", "Fresh ridges and families", COLUMNS, tuple(rows)),), notes=(NOTE,)
    )


def _rows(data: Dataset, schemes: dict[str, Scheme], levels: int) -> list[tuple[Cell, ...]]:
    surfaces = {name: whole_surface(scheme, data, levels) for name, scheme in schemes.items()}
    return [(data.name, name, *_against(surfaces[LOOP], own)) for name, own in surfaces.items()]


def _against(loop: WholeSurface, surface: WholeSurface) -> tuple[float, ...]:
    def percent(name: str) -> float:
        return 100 * (1 - float(getattr(surface, name).mean() / getattr(loop, name).mean()))

    return (
        percent("distance"),
        percent("largest"),
        percent("normal"),
        float(np.mean(surface.jump / loop.jump)),
        100 * (1 - float((surface.distance / loop.distance).max())),
        100 * (1 - float((surface.normal / loop.normal).max())),
    )


EXPERIMENT = Experiment(
    name="fresh-ridges",
    title="Fresh ridges and families",
    source="Beyond the paper.",
    run=run,
    seconds=240,
    reads=model_files,
)
