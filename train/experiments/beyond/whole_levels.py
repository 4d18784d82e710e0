"""The default model on every primitive and asset, after each level, with and without `limit`."""

from dataclasses import dataclass
from itertools import islice

from pns_common import Mesh
from train.experiments.beyond.models import models_and_assets
from train.experiments.beyond.whole_meshes import (
    MORE,
    REFERENCE,
    Row,
    meshes,
    rows_of,
)
from train.experiments.harness.contenders import LOOP, OURS, contenders
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.self_intersection import crossing_faces

LEVELS = 4
# Of a refined mesh: deeper levels of larger meshes are left out.
MOST_FACES = 150_000

NOTE = (
    f"Meshes of up to {MOST_FACES:,} faces after refinement; words as above. *Of these crossing "
    "before*: their control mesh has self-intersecting faces itself."
)


@dataclass(frozen=True, slots=True)
class LevelRow:
    """The default model on all meshes after so many levels."""

    levels: int = column("Levels", "d")
    limit: bool = column("Limit")
    meshes: int = column("Meshes", "d")
    whole: int = column("Whole", "d")
    flipped: int = column("Flipped", "d")
    intersecting: int = column("Self-intersecting", "d")
    of_loop: int = column("Loop's", "d")
    of_n1: int = column("N1's", "d")
    crossed: int = column("Meshes with more than Loop's + 2 %", "d")
    crossed_before: int = column("Of these crossing before", "d")
    overshoot_percent: float | None = column("Largest overshoot %", ".2f")
    volume_to_loop: float | None = column("Least volume / Loop's", ".3f")
    volume_to_n1: float | None = column("Largest volume / N1's", ".3f")


def run(laboratory: Laboratory) -> Outcome:
    """Refine all meshes to every level."""
    schemes = {name: contenders()[name] for name in (LOOP, REFERENCE, OURS)}
    chosen = [
        (name, mesh, crossing_faces(mesh))
        for name, mesh in islice(meshes(laboratory), laboratory.scale.instances)
        if _faces(mesh, 1) <= MOST_FACES
    ]
    rows: list[LevelRow] = []
    for levels in range(1, min(LEVELS, laboratory.scale.levels) + 1):
        for limit in (False, True):
            each: list[Row] = []
            for number, (name, mesh, control) in enumerate(chosen):
                laboratory.progress(f"whole-levels {levels}: {name}", number, len(chosen))
                if _faces(mesh, levels) <= MOST_FACES:
                    each += rows_of(name, mesh, levels, schemes, control=control, limit=limit)
            rows.append(_row(levels, each, limit=limit))
    return Outcome((table("whole_levels", "Each level", LevelRow, rows),), notes=(NOTE,))


def _faces(mesh: Mesh, levels: int) -> int:
    return len(mesh.faces) * 4**levels


def _row(levels: int, rows: list[Row], *, limit: bool) -> LevelRow:
    of = {name: [row for row in rows if row.method == name] for name in (LOOP, REFERENCE, OURS)}
    ours, plain = of[OURS], of[LOOP]
    crossed = [
        row
        for row, by_loop in zip(ours, plain, strict=True)
        if row.intersecting > MORE * by_loop.intersecting
    ]
    to_loop = [row.volume_to_loop for row in ours if row.volume_to_loop is not None]
    to_n1 = [row.volume_to_n1 for row in ours if row.volume_to_n1 is not None]
    return LevelRow(
        levels=levels,
        limit=limit,
        meshes=len(ours),
        whole=sum(row.whole for row in ours),
        flipped=sum(row.flipped for row in ours),
        intersecting=sum(row.intersecting for row in ours),
        of_loop=sum(row.intersecting for row in plain),
        of_n1=sum(row.intersecting for row in of[REFERENCE]),
        crossed=len(crossed),
        crossed_before=sum(row.control > 0 for row in crossed),
        overshoot_percent=max((row.overshoot_percent for row in ours), default=None),
        volume_to_loop=min(to_loop, default=None),
        volume_to_n1=max(to_n1, default=None),
    )


EXPERIMENT = Experiment(
    name="whole-levels",
    title="Primitives and assets, level by level",
    source="Beyond the paper.",
    run=run,
    seconds=80,
    reads=models_and_assets,
)
