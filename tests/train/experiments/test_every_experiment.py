"""Every experiment runs from end to end, at a scale of seconds where no number means anything."""

import csv

import pytest

from tests.support.shared import shared_path
from train.experiments.harness.laboratory import SMALL, Laboratory
from train.experiments.harness.page import markdown_page
from train.experiments.harness.reproduce import reproduce
from train.experiments.registry import EXPERIMENTS

NAMES = (
    "structural, spectral, ablation, headline, cross-section, repeated, c-sweep, budget, capacity, "
    "saddle, sphere-ridge, features, extended, lifted-stars, cad, models, families, stability, "
    "decimation, real-meshes, real-validation, form-sweep, whole-meshes, whole-levels, spheres, "
    "fresh-ridges, fairness, shading, hero, published"
)


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


def laboratory_for(experiment, output):
    published = shared_path("published") if experiment.needs_published else None
    assets = shared_path("assets") if experiment.needs_assets else None
    networks = output / "cache" / "networks"
    return Laboratory(SMALL, networks, None, published, lambda *_: None, assets)


def test_there_is_an_experiment_for_each_table_and_figure():
    assert set(EXPERIMENTS) == set(NAMES.split(", "))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_writes_its_tables_and_figures(name, output):
    experiment = EXPERIMENTS[name]
    record = reproduce(experiment, laboratory_for(experiment, output), output)
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
        pdf = (output / "figures" / f"{figure.name}.pdf").read_bytes()
        assert png.startswith(b"\x89PNG")
        assert len(png) > 10_000
        assert pdf.startswith(b"%PDF")
    page = markdown_page(EXPERIMENTS, {name: record})
    assert f"## {experiment.title}" in page
    assert "no number here means anything" in page
    assert page.count(".csv)") == len(record.tables)
    assert page.count("![") == len(record.figures)


def test_ratios_of_pns_never_pass_one(output):
    experiment = EXPERIMENTS["c-sweep"]
    table = reproduce(experiment, laboratory_for(experiment, output), output).tables[0]
    column = [column.name for column in table.columns].index("max_ratio")
    for row in table.rows:
        assert 0 < row[column] <= 1 + 1e-12
