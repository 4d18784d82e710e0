"""The decimation experiment: which meshes and methods it shows, and what it depends on."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import train.experiments.beyond.decimation as experiment
from pns_common import load_model, loop, pns
from tests.support.experiments import assert_written
from tests.support.meshes import bumpy_sphere, grid
from train.data.dense_meshes import ASSET, CAD, CONTROL
from train.experiments.beyond.decimation import EXPERIMENT, collected, methods
from train.experiments.beyond.decimation_figures import pictured
from train.experiments.harness.laboratory import FULL, SMALL, Laboratory
from train.experiments.harness.reproduce import content_key, reproduce

pytestmark = pytest.mark.usefixtures("small_figures")

# Where it does not matter which methods there are.
FEW = {"Loop": loop(), "PNS": pns(load_model("paper"))}


def laboratory(folder, assets=None, scale=SMALL):
    return Laboratory(scale, folder / "networks", None, None, lambda *_: None, assets)


def write(path, shape):
    trimesh.Trimesh(*shape, process=False).export(path)


@pytest.fixture
def assets(tmp_path):
    folder = tmp_path / "assets"
    folder.mkdir()
    write(folder / "spot.ply", bumpy_sphere(subdivisions=3))
    write(folder / "blob_control_mesh.ply", bumpy_sphere())
    write(folder / "flat.ply", grid(40))
    return folder


def test_files_join_the_parts_and_the_page_says_which(tmp_path, assets, monkeypatch):
    monkeypatch.setattr(experiment, "methods", lambda: FEW)
    record = reproduce(EXPERIMENT, laboratory(tmp_path, assets), tmp_path)
    tables = {table.name: table for table in record.tables}
    listed = {row[0]: row for row in tables["decimation_meshes"].rows}
    assert listed["spot.ply"][1] == ASSET
    assert listed["blob_control_mesh.ply"][1] == CONTROL
    assert listed["torus"][1] == CAD
    assert "plane" in listed["flat.ply"][-1]
    measured = {row[0] for row in tables["decimation_by_mesh"].rows}
    # At this scale one of a kind.
    assert measured == {"spot.ply", "blob_control_mesh.ply", "torus"}
    assert not any("--assets" in note for note in record.notes)


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    return tmp_path_factory.mktemp("parts")


@pytest.fixture(scope="module")
def parts_alone(output):
    return reproduce(EXPERIMENT, laboratory(output), output)


def test_writes_its_tables_and_figures(parts_alone, output):
    assert_written(parts_alone, output, "decimation")


def test_without_a_folder_the_page_says_so(parts_alone):
    assert any("--assets" in note for note in parts_alone.notes)
    kinds = {row[1] for row in parts_alone.tables[2].rows}
    assert kinds == {CAD}


def test_improvements_follow_from_the_distances_beside_them(parts_alone):
    summary, by_mesh, _, errors = parts_alone.tables
    assert [column.name for column in by_mesh.columns[:5]] == [
        *("mesh", "level", "loop", "modified_butterfly", "modified_butterfly_percent")
    ]
    percents = []
    for row in by_mesh.rows:
        assert row[4] == pytest.approx(100 * (1 - row[3] / row[2]))
        percents.append(row[4])
    assert summary.rows[0][0] == "Modified Butterfly"
    assert summary.rows[0][2] == pytest.approx(np.mean(percents))
    assert len(errors.rows) == len(by_mesh.rows) * len(methods())


def test_full_scale_takes_every_part():
    dense, left_out = collected(laboratory(experiment.Path(), scale=FULL))
    assert len(dense) == 7
    assert left_out == []


def test_what_cannot_be_simplified_is_listed(tmp_path, monkeypatch):
    real = experiment.simplify

    def all_but_the_torus(dense):
        return experiment.NotSimplified(dense) if dense.name == "torus" else real(dense)

    monkeypatch.setattr(experiment, "simplify", all_but_the_torus)
    monkeypatch.setattr(experiment, "methods", lambda: FEW)
    outcome = experiment.run(laboratory(tmp_path, scale=replace(SMALL, instances=2)))
    assert outcome.tables[2].rows[-1][0] == "torus"
    assert "manifold" in outcome.tables[2].rows[-1][-1]


def test_each_bundled_model_is_one_method_and_the_default_is_last():
    names = list(methods())
    assert names[:2] == ["Loop", "Modified Butterfly"]
    assert "PNS `paper`" in names
    assert names[-1] == f"PNS `{load_model().name}`"
    assert len(set(names)) == len(names)


def test_two_models_are_two_rows_and_two_markers(tmp_path, monkeypatch):
    weak, strong = (pns(load_model("paper"), budget) for budget in (0.2, 0.5))
    schemes = {"Loop": loop(), "Modified Butterfly": loop(), "PNS `a`": weak, "PNS `b`": strong}
    monkeypatch.setattr(experiment, "methods", lambda: schemes)
    outcome = experiment.run(laboratory(tmp_path))
    assert [row[0] for row in outcome.tables[0].rows] == list(schemes)[1:]
    drawn = outcome.figures[0].draw()
    labels = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert labels == ["Modified Butterfly", "PNS a", "PNS b"]
    colours = {line.get_color() for line in drawn.axes[0].lines if line.get_marker() != "None"}
    assert len(colours) == 3


def test_other_files_and_another_model_make_it_run_again(tmp_path, assets, monkeypatch):
    keys = {content_key(EXPERIMENT, laboratory(tmp_path, folder)) for folder in (None, assets)}
    write(assets / "spot.ply", bumpy_sphere(seed=1, subdivisions=3))
    keys.add(content_key(EXPERIMENT, laboratory(tmp_path, assets)))
    monkeypatch.setattr(experiment, "model_files", lambda _: ())
    files = experiment.read_files(laboratory(tmp_path, assets))
    assert sorted(path.name for path in files) == [
        *("blob_control_mesh.ply", "flat.ply", "spot.ply")
    ]
    assert len(keys) == 3


def test_the_figure_shows_chosen_meshes_or_the_first(tmp_path):
    dense, _ = collected(laboratory(tmp_path, scale=FULL))
    pairs = [experiment.Pair(mesh, mesh.mesh, 0) for mesh in dense]
    assert [pair.dense.name for pair in pictured(pairs)] == ["pipe", "pulley"]
    others = [pair for pair in pairs if pair.dense.name not in ("pipe", "pulley")]
    assert pictured(others) == others[:2]
