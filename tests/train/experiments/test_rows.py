"""A table of rows: its columns are the fields, in their order."""

from dataclasses import dataclass

import pytest

from train.experiments.harness.experiment import Column, Table
from train.experiments.harness.rows import column, table


@dataclass(frozen=True, slots=True)
class Row:
    """Two columns, one of them formatted."""

    name: str = column("Name")
    gain: float | None = column("Gain %", "+.1f")


def test_fields_become_columns_and_values_cells():
    made = table("gains", "All gains", Row, (Row("a", 1.5), Row("b", gain=None)))
    columns = (Column("name", "Name"), Column("gain", "Gain %", "+.1f"))
    assert made == Table("gains", "All gains", columns, (("a", 1.5), ("b", None)))
    assert table("none", "No gains", Row, ()).columns == columns


def test_no_cell_is_left_out():
    with pytest.raises(TypeError, match="gain"):
        Row("a")
