"""Every experiment runs, and the published networks give the published numbers."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pns_common import Mesh, pns
from tests.support.meshes import bent, grid
from tests.support.shared import shared_path
from train.certificates import displacement
from train.experiments.harness import render, style
from train.experiments.harness import reproduce as harness
from train.experiments.harness.laboratory import FULL, SMALL, Laboratory
from train.experiments.harness.page import markdown_page
from train.experiments.harness.reproduce import reproduce
from train.experiments.harness.style import TITLES
from train.experiments.harness.variants import PNS, fit_variant, variant_scheme
from train.experiments.paper.hero_panels import write_panels
from train.experiments.paper.methods import hard_instance
from train.experiments.paper.published import run as run_published
from train.experiments.registry import EXPERIMENTS
from train.fitting.determinism import deterministic
from train.fitting.trainer import fit
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.refining import refine

NAMES = (
    "structural, spectral, ablation, headline, cross-section, repeated, c-sweep, budget, capacity, "
    "saddle, sphere-ridge, hero, published"
)


@pytest.fixture(scope="module", autouse=True)
def quick():
    """One level of T1, and figures as PNG alone with few points: other tests claim the rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(displacement, "LARGEST", 0)
        patch.setattr(harness, "FORMATS", {"png": harness.FORMATS["png"]})
        patch.setattr(style, "STYLE", {**style.STYLE, "savefig.dpi": 40})
        patch.setattr(render, "WIDTH", render.WIDTH // 4)
        patch.setattr(render, "HEIGHT", render.HEIGHT // 4)
        yield


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


def small_laboratory(output):
    return Laboratory(SMALL, output / "cache" / "networks", None, shared_path("published"))


def test_there_is_an_experiment_for_each_table_and_figure_of_the_paper():
    assert set(EXPERIMENTS) == set(NAMES.split(", "))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_writes_its_tables_its_figures_and_its_part_of_the_page(name, output):
    """At a scale of seconds, where no number means anything, but ratios pass 1 nowhere."""
    record = reproduce(EXPERIMENTS[name], small_laboratory(output), output)
    for table in record.tables:
        with (output / f"{table.name}.csv").open(encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert header == [column.name for column in table.columns]
        assert len(set(header)) == len(header)
        assert len(rows) == len(table.rows) > 0
        if name == "c-sweep":
            place = header.index("max_ratio")
            assert all(0 < row[place] <= 1 + 1e-12 for row in table.rows)
    for figure in record.figures:
        png = (output / "figures" / f"{figure.name}.png").read_bytes()
        assert png.startswith(b"\x89PNG")
        assert len(png) > 2000
    page = markdown_page(EXPERIMENTS, {name: record})
    assert f"## {EXPERIMENTS[name].title}" in page
    assert "no number here means anything" in page
    assert page.count(".csv)") == len(record.tables) > 0
    assert page.count("![") == len(record.figures)


def test_the_full_variant_is_the_operator_and_trains_as_it():
    recipe, mesh = paper(), Mesh(*grid(6, bent))
    network = initial_network(recipe)
    ours = refine(mesh, variant_scheme(PNS, network, recipe), 2)
    theirs = refine(mesh, pns(recipe_model(recipe, network), recipe.budget), 2)
    np.testing.assert_allclose(ours.mesh.vertices, theirs.mesh.vertices, atol=1e-7)
    np.testing.assert_allclose(ours.ratio, theirs.ratio, atol=1e-6)
    recipe = replace(recipe, steps=3)
    losses = fit_variant(PNS, recipe).losses, fit(recipe, lambda done, loss: None).losses
    np.testing.assert_allclose(*losses, rtol=1e-6)


def test_panels_of_the_first_figure_have_a_column_a_method_and_a_row_for_one_step_and_all(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "panels"
    write_panels(Laboratory(SMALL, tmp_path / "networks", None, None), folder)
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["1-1.npz", *(f"{row}-{place}.npz" for row in (1, 2) for place in (2, 3, 4))]
    control = len(hard_instance().mesh.faces)
    for place, method in enumerate(("loop", "pns", "unconstrained"), start=2):
        for row, steps in ((1, 1), (2, SMALL.levels)):
            with np.load(folder / f"{row}-{place}.npz") as panel:
                assert panel["title"] == TITLES[method]
                assert len(panel["faces"]) == control * 4**steps
                assert panel["distance"].shape == (len(panel["vertices"]),)
                assert panel["distance"].min() >= 0
                # Loop is no distance from itself.
                assert ("ratio 0.00" in str(panel["note"])) == (method == "loop")


POINTS = 0.02
# Angles of 1.6e-3 radians in float32: the published 0.59 % is rounding (see the page's note).
ROUNDING = ("pns_saddle", "normal_near")


def test_published_networks_give_the_published_numbers_to_the_printed_digit(tmp_path):
    with deterministic():
        outcome = run_published(Laboratory(FULL, tmp_path, None, shared_path("published")))
    improvements, ablation = outcome.tables
    names = [column.name for column in improvements.columns]
    assert names == ["checkpoint", "dataset", "metric", "improvement_percent", "published_percent"]
    assert (len(improvements.rows), len({row[0] for row in improvements.rows})) == (34, 13)
    for checkpoint, dataset, metric, ours, published in improvements.rows:
        if (checkpoint, metric) != ROUNDING:
            assert ours == pytest.approx(published, abs=POINTS), (checkpoint, dataset, metric)
    for checkpoint, *numbers in ablation.rows:
        # Ratios that grow level by level carry float32 rounding along.
        assert numbers[::2] == pytest.approx(numbers[1::2], rel=5e-4, abs=1e-4), checkpoint
