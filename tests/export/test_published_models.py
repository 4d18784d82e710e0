"""Model files of the published networks: the operator's own, under their own budgets."""

import numpy as np
import pytest
from typer.testing import CliRunner

import export.run
from export.published import export_published
from pns_common import ModelError, load_model, pns
from tests.support.control_points import refine
from tests.support.networks import published_model
from tests.support.shared import published, shared_path
from train.data.datasets import ridge_held_out

BUDGETS = {
    "ablation_PNS_full_trained": 0.5,
    "pns_capacity_h64": 0.5,
    "pns_headline_C0.5": 0.5,
    "pns_saddle": 0.5,
    "pns_sweep_C0.1": 0.1,
    "pns_sweep_C0.25": 0.25,
    "pns_sweep_C0.5": 0.5,
    "pns_sweep_C1.0": 1.0,
}


def test_the_command_writes_a_file_for_each_operator(tmp_path):
    source = str(shared_path("published"))
    arguments = ["--published", source, "--output", str(tmp_path / "models")]
    outcome = CliRunner().invoke(export.run.app, arguments, catch_exceptions=False)
    assert outcome.exit_code == 0
    paths = sorted((tmp_path / "models").iterdir())
    assert [path.name for path in paths] == [f"{name}.onnx" for name in sorted(BUDGETS)]
    for path in paths:
        model = load_model(path)
        assert model.card.budget == BUDGETS[path.stem]
        assert model.card.gate_sharpness == 10
        assert model.card.training["checkpoint"] == path.stem


def test_a_file_refines_as_the_published_weights_do(tmp_path):
    export_published(shared_path("published"), tmp_path)
    ours = load_model(tmp_path / "pns_headline_C0.5.onnx")
    theirs = published_model(published("weights.npz"), "pns_headline_C0.5")
    mesh = ridge_held_out().instances[0].mesh
    refined, expected = (
        refine(mesh, pns(model), levels=2, reference_length=1.0).mesh.vertices
        for model in (ours, theirs)
    )
    np.testing.assert_allclose(refined, expected, atol=1e-7)


def test_a_folder_without_networks_of_the_operator_is_refused(tmp_path):
    folder = tmp_path / "others"
    folder.mkdir()
    weights = {
        "unconstrained/net.0.weight": np.zeros((3, 12), np.float32),
        "unconstrained/net.0.bias": np.zeros(3, np.float32),
    }
    np.savez(folder / "weights.npz", **weights)
    with pytest.raises(ModelError, match="others only"):
        export_published(folder, tmp_path / "models")
    assert not (tmp_path / "models").exists()
