"""Ridges and other families that no recipe has seen, after four levels, beside the controls."""

from dataclasses import dataclass

import numpy as np

from train.data.datasets import Dataset, draw_ridges
from train.data.stream import held_out_families, trained_families
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, contenders
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.whole_surface import WholeSurface, whole_surface
from train.refining import AnyScheme

SEED, COUNT = 271_828, 10
NOTE = (
    "Ten new draws of the paper's ridges (on its patches, reference length 1), and the other "
    "families' test sets, all vertices and faces after the last level. Improvements are ratios of "
    "means over the instances; the worst instance is the one that gains least. The jump is the "
    "largest angle between neighbouring faces, mean over instances of the ratio to Loop's."
)


@dataclass(frozen=True, slots=True)
class Row:
    """One method on one family, over Loop."""

    family: str = column("Family")
    method: str = column("Method")
    distance_percent: float = column("RMSE %", "+.1f")
    largest_percent: float = column("Largest %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    jump: float = column("Jump / Loop's", ".2f")
    worst_percent: float = column("Worst instance %", "+.1f")
    worst_normal_percent: float = column("Worst in normals %", "+.1f")


def run(laboratory: Laboratory) -> Outcome:
    """Measure all families."""
    scale = laboratory.scale
    ridges = Dataset("fresh-ridges", draw_ridges(seed=SEED, count=COUNT))
    families = [ridges, *trained_families(), *held_out_families()]
    rows: list[Row] = []
    for number, family in enumerate(families[: scale.instances]):
        laboratory.progress(f"fresh-ridges: {family.name}", number, len(families))
        data = Dataset(family.name, family.instances[: scale.instances])
        rows += _rows(data, contenders(), scale.levels)
    return Outcome((table("fresh_ridges", "Fresh ridges and families", Row, rows),), notes=(NOTE,))


def _rows(data: Dataset, schemes: dict[str, AnyScheme], levels: int) -> list[Row]:
    surfaces = {name: whole_surface(scheme, data, levels) for name, scheme in schemes.items()}
    return [_row(data.name, name, own, surfaces[LOOP]) for name, own in surfaces.items()]


def _row(family: str, method: str, surface: WholeSurface, loop: WholeSurface) -> Row:
    def percent(name: str) -> float:
        return 100 * (1 - float(getattr(surface, name).mean() / getattr(loop, name).mean()))

    return Row(
        family=family,
        method=method,
        distance_percent=percent("distance"),
        largest_percent=percent("largest"),
        normal_percent=percent("normal"),
        jump=float(np.mean(surface.jump / loop.jump)),
        worst_percent=100 * (1 - float((surface.distance / loop.distance).max())),
        worst_normal_percent=100 * (1 - float((surface.normal / loop.normal).max())),
    )


EXPERIMENT = Experiment(
    name="fresh-ridges",
    title="Fresh ridges and families",
    source="Beyond the paper.",
    run=run,
    seconds=70,
    reads=model_files,
)
