"""Run experiments and keep what they found, so that a finished one is not run again."""

import csv
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec

from pns_common.files import replacing
from train.experiments.harness.experiment import Cell, Column, Experiment, Figure, Table
from train.experiments.harness.laboratory import Laboratory, code
from train.experiments.harness.style import shared_style
from train.fitting.determinism import deterministic

# What each figure is written as, without what would be another in each run.
FORMATS: Mapping[str, Mapping[str, None]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
}


@dataclass(frozen=True, slots=True)
class FigureRecord:
    """A figure that lies in the folder `figures`."""

    name: str
    caption: str


@dataclass(frozen=True, slots=True)
class Record:
    """The result of a finished experiment: all that the page needs.

    Attributes:
        key: hash of all that the experiment was made from.
    """

    key: str
    scale: str
    tables: tuple[Table, ...]
    figures: tuple[FigureRecord, ...]
    notes: tuple[str, ...]


def reproduce(
    experiment: Experiment, laboratory: Laboratory, output: Path, *, force: bool = False
) -> Record:
    """Run an experiment and write its tables and figures; a finished one is only read again."""
    kept = output / "cache" / f"{experiment.name}.json"
    key = content_key(experiment, laboratory)
    if not force:
        record = read_record(kept)
        if record is not None and record.key == key and _written(record, output):
            return record
    with deterministic():
        outcome = experiment.run(laboratory)
    for table in outcome.tables:
        write_csv(table, output / f"{table.name}.csv")
    for figure in outcome.figures:
        save_figure(figure, output / "figures")
    figures = tuple(FigureRecord(figure.name, figure.caption) for figure in outcome.figures)
    record = Record(key, laboratory.scale.name, outcome.tables, figures, outcome.notes)
    # Last: an experiment that was cut off has no record, and is run again.
    _replace(kept, lambda path: path.write_bytes(msgspec.json.encode(record)))
    return record


def read_record(path: Path) -> Record | None:
    """Return a kept record; None where there is none, or one of another version."""
    if not path.is_file():
        return None
    try:
        return msgspec.json.decode(path.read_bytes(), type=Record)
    except msgspec.MsgspecError:
        return None


def content_key(experiment: Experiment, laboratory: Laboratory) -> str:
    """Return a hash of an experiment's inputs: code, scale, checkpoints, published data."""
    inputs: list[Path] = []
    if laboratory.checkpoints is not None:
        inputs += laboratory.checkpoints.glob("*.safetensors")
    if experiment.needs_published and laboratory.published is not None:
        inputs += (path for path in laboratory.published.rglob("*") if path.is_file())
    digest = hashlib.sha256(msgspec.json.encode(laboratory.scale) + code())
    for path in sorted(inputs):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def write_csv(table: Table, path: Path) -> None:
    """Write a table with every digit; an empty cell is None."""

    def write(temporary: Path) -> None:
        with temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([column.name for column in table.columns])
            writer.writerows(table.rows)

    _replace(path, write)


def save_figure(figure: Figure, folder: Path) -> None:
    """Draw a figure in the shared style and write it as PNG and PDF, without dates."""
    folder.mkdir(parents=True, exist_ok=True)
    with shared_style():
        drawing = figure.draw()
        for ending, metadata in FORMATS.items():
            _replace(
                folder / f"{figure.name}.{ending}",
                # The temporary name hides the format.
                lambda path, e=ending, m=metadata: drawing.savefig(path, format=e, metadata=m),
            )


def formatted(cell: Cell, column: Column) -> str:
    """Return a cell as the page shows it."""
    if cell is None:
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, int | float):
        return format(cell, column.digits)
    return cell


def _written(record: Record, output: Path) -> bool:
    names = [output / f"{table.name}.csv" for table in record.tables]
    for figure in record.figures:
        names += [output / "figures" / f"{figure.name}.{ending}" for ending in FORMATS]
    return all(path.is_file() for path in names)


def _replace(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file in one piece: a reader sees the old one or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        write(temporary)
