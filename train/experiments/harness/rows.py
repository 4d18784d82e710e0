"""Rows of a table as frozen dataclasses: a field is a column, and says how the page shows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, fields
from typing import TYPE_CHECKING, Any, TypeVar

from train.experiments.harness.experiment import Column, Table

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
