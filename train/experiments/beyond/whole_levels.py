"""The default model on every primitive and asset, after each level, with and without `limit`."""

from train.experiments.beyond.whole_meshes import (
    MORE,
    REFERENCE,
    Row,
    meshes,
    read_files,
    rows_of,
)
from train.experiments.harness.contenders import LOOP, OURS, contenders
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory

LEVELS = 4
MOST_FACES = 150_000
"""Of a refined mesh: deeper levels of larger meshes are left out."""

COLUMNS = (
    Column("levels", "Levels", "d"),
    Column("limit", "Limit"),
    Column("meshes", "Meshes", "d"),
    Column("whole", "Whole", "d"),
    Column("flipped", "Flipped", "d"),
    Column("intersecting", "Self-intersecting", "d"),
    Column("of_loop", "Loop's", "d"),
    Column("of_n1", "N1's", "d"),
    Column("crossed", "Meshes with more than Loop's + 2 %", "d"),
    Column("crossed_before", "Of these crossing before", "d"),
    Column("overshoot_percent", "Largest overshoot %", ".2f"),
    Column("volume_to_loop", "Least volume / Loop's", ".3f"),
    Column("volume_to_n1", "Largest volume / N1's", ".3f"),
)
NOTE = (
    f"Meshes of up to {MOST_FACES:,} faces after refinement; words as above. *Of these crossing "
    "before*: their control mesh has self-intersecting faces itself."
)


def run(laboratory: Laboratory) -> Outcome:
    """Refine all meshes to every level."""
    schemes = {name: contenders()[name] for name in (LOOP, REFERENCE, OURS)}
    chosen = list(meshes(laboratory))[: laboratory.scale.instances]
    rows: list[tuple[Cell, ...]] = []
    for levels in range(1, min(LEVELS, laboratory.scale.levels) + 1):
        for limit in (False, True):
            each: list[Row] = []
            for number, (name, mesh) in enumerate(chosen):
                laboratory.progress(f"whole-levels {levels}: {name}", number, len(chosen))
                if len(mesh.faces) * 4**levels <= MOST_FACES:
                    each += rows_of(name, mesh, levels, schemes, limit=limit)
            rows.append(_row(levels, each, limit=limit))
    return Outcome((Table("whole_levels", "Each level", COLUMNS, tuple(rows)),), notes=(NOTE,))


def _row(levels: int, rows: list[Row], *, limit: bool) -> tuple[Cell, ...]:
    of = {name: [row for row in rows if row.method == name] for name in (LOOP, REFERENCE, OURS)}
    ours, plain = of[OURS], of[LOOP]
    crossed = [
        row
        for row, by_loop in zip(ours, plain, strict=True)
        if row.intersecting > MORE * by_loop.intersecting
    ]
    return (
        levels,
        limit,
        len(ours),
        sum(row.whole for row in ours),
        sum(row.flipped for row in ours),
        *(sum(row.intersecting for row in of[name]) for name in (OURS, LOOP, REFERENCE)),
        len(crossed),
        sum(row.control > 0 for row in crossed),
        max((row.overshoot_percent for row in ours), default=None),
        min((r.volume_to_loop for r in ours if r.volume_to_loop is not None), default=None),
        max((r.volume_to_n1 for r in ours if r.volume_to_n1 is not None), default=None),
    )


EXPERIMENT = Experiment(
    name="whole-levels",
    title="Primitives and assets, level by level",
    source="Beyond the paper.",
    run=run,
    seconds=400,
    reads=read_files,
)
