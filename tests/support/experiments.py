"""A run of any experiment leaves its tables, its figures and its part of the page."""

import csv

from train.experiments.harness.page import markdown_page
from train.experiments.registry import EXPERIMENTS


def assert_written(record, output, name):
    assert record.tables
    for table in record.tables:
        with (output / f"{table.name}.csv").open(encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert header == [column.name for column in table.columns]
        assert len(set(header)) == len(header)
        assert len(rows) == len(table.rows) > 0
    for figure in record.figures:
        assert figure.caption
        png = (output / "figures" / f"{figure.name}.png").read_bytes()
        assert png.startswith(b"\x89PNG")
        assert len(png) > 2000
    page = markdown_page(EXPERIMENTS, {name: record})
    assert f"## {EXPERIMENTS[name].title}" in page
    assert "no number here means anything" in page
    assert page.count(".csv)") == len(record.tables)
    assert page.count("![") == len(record.figures)
