"""An experiment as a function of the laboratory; its tables and figures are data."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypeVar

from matplotlib.figure import Figure as Drawing

from train.experiments.harness.laboratory import Laboratory

Cell = str | float | int | bool | None


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        name: heading in the CSV file.
        heading: heading on the page.
        digits: how the page formats a number, as in `format(value, digits)`; the CSV file keeps
            every digit.
    """

    name: str
    heading: str
    digits: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """A table: `results/NAME.csv`, and a part of the page. None is an empty cell."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure: `results/figures/NAME.png` and `.pdf`; `draw` makes it in the shared style."""

    name: str
    caption: str
    draw: Callable[[], Drawing]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of an experiment. Notes are Markdown paragraphs: above all, where it differs."""

    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Experiment:
    """A table or figure of the paper, or one that it names as open.

    Attributes:
        name: on the command line.
        title: on the page.
        source: where the paper has it.
        run: does the work; at `SMALL` scale it takes a few seconds.
        seconds: about how long it takes at full scale, for the estimate.
        needs_published: cannot run without the author's published data.
    """

    name: str
    title: str
    source: str
    run: Callable[[Laboratory], Outcome]
    seconds: float
    needs_published: bool = False


if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Row = TypeVar("Row", bound="DataclassInstance")


def column(heading: str, digits: str = "") -> Any:
    """Return a field of a row: its heading on the page, and how the page formats its number."""
    return field(metadata={"heading": heading, "digits": digits})


def table(name: str, title: str, kind: type[Row], rows: Iterable[Row]) -> Table:
    """Return the table whose columns are the fields of the rows' class, in their order."""
    columns = tuple(Column(each.name, **each.metadata) for each in fields(kind))
    cells = (tuple(getattr(row, column.name) for column in columns) for row in rows)
    return Table(name, title, columns, tuple(cells))
