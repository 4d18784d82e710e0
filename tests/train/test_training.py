"""Training takes the product's step, writes the same bytes again, and says what it cannot do."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import torch
import trimesh
from typer.testing import CliRunner

import train.fitting.command
import train.run
from export.model_file import export_model
from pns_common import Mesh, ParameterError, clean, load_model, loop, pns, refine
from tests.support.control_points import refine as refine_once
from tests.support.meshes import grid
from tests.support.shared import shared_path
from train.connectivity import connect
from train.data import pair_store, shape_library
from train.data.batch import pairs_sharing_a_face
from train.data.datasets import ridge_held_out
from train.data.icosphere import icosphere
from train.data.shape_library import ListedShape, read_arrays, sum_of, take_shapes
from train.fitting.control_mesh import ControlMesh
from train.fitting.quiet import quiet_term
from train.fitting.trainer import (
    distance_loss,
    fairness_loss,
    fit,
    normal_loss,
    proximity_loss,
    weighted_loss,
)
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.from_recipe import initial_directed, initial_network, paper_rule
from train.models.recipe import LossWeights, of_length
from train.models.recipes import RECIPES, general, paper
from train.models.torch_model import recipe_model

ROOT = Path(__file__).resolve().parents[2]


def ignore(done, loss):
    pass


# --- on one step ----------------------------------------------------------------------------------


def test_fairness_pairs_are_the_interior_edges_that_share_a_face():
    mesh = ridge_held_out().instances[0].mesh
    level = connect(mesh.faces, len(mesh.vertices))
    corners = [set(row) for row in level.edges[level.interior].tolist()]
    faces = {frozenset(face) for face in mesh.faces.tolist()}
    expected = {
        (i, j)
        for i in range(len(corners))
        for j in range(i)
        if frozenset(corners[i] | corners[j]) in faces
    }
    pairs = [(max(pair), min(pair)) for pair in pairs_sharing_a_face(level).tolist()]
    assert len(pairs) == len(set(pairs))
    assert set(pairs) == expected


def test_each_weight_counts_its_own_term_of_the_loss():
    distance, ratio, pairs = torch.tensor([3.0, -4.0]), torch.tensor([1.0, 2.0]), [[0, 1]]
    up, across = torch.tensor([[0.0, 0, 1]] * 2), torch.tensor([[0.0, 0, 1], [0, 1, 0]])
    terms = {"distance": 12.5, "normal": 0.5, "fairness": 2.0, "proximity": 2.5}
    made = distance_loss(distance), normal_loss(across, up)
    made += fairness_loss(across, torch.tensor(pairs)), proximity_loss(ratio)
    assert [float(term) for term in made] == pytest.approx([*terms.values()])
    for name, term in terms.items():
        weights = LossWeights(**{other: float(other == name) * 2 for other in terms})
        loss = weighted_loss(weights, distance, across, up, ratio, torch.tensor(pairs))
        assert float(loss) == pytest.approx(2 * term)


def test_the_training_step_is_the_products_step():
    mesh, network = ridge_held_out().instances[0].mesh, initial_network(paper()).double()
    level = connect(mesh.faces, len(mesh.vertices))
    step = paper_rule(paper(), network)(torch.tensor(mesh.vertices), level)
    refined = refine_once(mesh, pns(recipe_model(paper(), network), 0.5), 1, 1.0)
    np.testing.assert_allclose(step.points.detach(), refined.mesh.vertices, rtol=0, atol=1e-14)
    np.testing.assert_allclose(step.ratio.detach(), refined.ratio, rtol=0, atol=1e-13)
    assert (refined.ratio > 0.05).any()
    step.points.square().sum().backward()
    assert all(parameter.grad.abs().max() > 0 for parameter in network.parameters())


def test_features_that_see_more_than_an_edge_are_refused_by_name():
    with pytest.raises(ParameterError, match=r"quiet.*signed-18"):
        quiet_term([Mesh(*grid())], "signed-18", seed=0)


@pytest.mark.parametrize("name", ["Fox", "low-poly-tree"])
def test_the_paper_model_tears_no_low_poly_asset(name):
    """Right angles and few faces: far from any ridge that the model was trained on."""
    scene = trimesh.load(shared_path(f"assets/{name}.glb"), process=False, force="mesh")
    scene.merge_vertices(merge_tex=True, merge_norm=True)
    mesh = clean(Mesh(np.asarray(scene.vertices), np.asarray(scene.faces))).mesh
    report, base = (refine_once(mesh, s, 2).report for s in (pns(load_model("paper")), loop()))
    assert [level["flipped_faces"] for level in report["levels"]] == [0, 0]
    jumps = [r["levels"][-1]["normal_jump_max"] for r in (report, base)]
    assert jumps[0] < 1.25 * jumps[1]


@pytest.mark.parametrize("name", sorted(RECIPES.keys() - {"general", "general-quad"}))
def test_the_same_seed_gives_the_same_bits(name):
    recipe, fits = of_length(RECIPES[name](3), 4), []
    for seed in (1, 2):
        torch.manual_seed(seed)
        fits.append(fit(recipe, ignore))
    assert fits[0].losses == fits[1].losses
    first, again = (each.network.parameters() for each in fits)
    assert all(torch.equal(*weights) for weights in zip(first, again, strict=True))


def test_training_lowers_the_loss_and_reports_every_step():
    reports = []
    # Without the quiet term, which is drawn anew at each step and would blur the comparison.
    base = of_length(paper(), 20)
    recipe = replace(base, training=msgspec.structs.replace(base.training, quiet=0.0))
    trained = fit(recipe, lambda done, loss: reports.append((done, loss)))
    assert reports == list(enumerate(trained.losses, start=1))
    assert trained.losses[-1] < 0.8 * trained.losses[0]


# --- on pairs -------------------------------------------------------------------------------------


def shaken(splits):
    """Return an open, uneven mesh of reference length about 1, with bends of all sizes."""
    mesh, rng = icosphere(splits), np.random.default_rng(5)
    points = mesh.vertices * [1, 0.8, 0.5] + 0.1 * rng.normal(size=mesh.vertices.shape)
    return Mesh(points, mesh.faces[: -len(mesh.faces) // 8])


def test_training_sees_the_limit_that_the_model_file_writes(tmp_path):
    mesh, recipe = shaken(2), general(0)
    smooth = refine(mesh, loop(), 2, reference_length=1.0).mesh.vertices
    base = ControlMesh(mesh, recipe.directed).limit(None).points.numpy()
    assert np.abs(base - smooth).max() < 1e-12
    network = initial_directed(recipe)
    with torch.no_grad():
        generator = torch.Generator().manual_seed(1)
        for weights in network.parameters():
            weights += 0.2 * torch.randn(weights.shape, generator=generator)
    export_model(Checkpoint(recipe, network, {}, ""), tmp_path / "model.onnx")
    model = load_model(tmp_path / "model.onnx")
    made = ControlMesh(mesh, recipe.directed).limit(network).points.detach().numpy()
    written = refine(mesh, pns(model), 2, reference_length=1.0).mesh.vertices
    assert np.abs(made - written).max() < 3e-6
    assert np.abs(written - smooth).max() > 1e-2


@pytest.fixture
def shapes(tmp_path, monkeypatch):
    """Return a folder with one training shape, which is all that the manifest lists."""
    sphere, folder = icosphere(4), tmp_path / "shapes"
    (folder / "training").mkdir(parents=True)
    np.savez(folder / "training" / "ball.npz", vertices=sphere.vertices, faces=sphere.faces)
    total = sum_of(read_arrays(folder / "training" / "ball.npz"))
    listed = ListedShape("ball", "training", "scan", "", "", "", "CC0", "", total)
    for module in (pair_store, shape_library):
        monkeypatch.setattr(module, "listed_shapes", lambda which=None: [listed])
    return folder


def test_the_same_recipe_on_pairs_gives_the_same_bytes(shapes, tmp_path):
    recipe, states = general(3), []
    plan = msgspec.structs.replace(recipe.training, procedural=2, meshes=1, real=0.5)
    recipe = replace(recipe, training=plan, steps=3)
    for name in ("first", "second"):
        trained = fit(recipe, ignore, (shapes, tmp_path / name))
        path = tmp_path / f"{name}.safetensors"
        save_checkpoint(path, Checkpoint(recipe, trained.network, {}, ""))
        states.append(path.read_bytes())
    assert states[0] == states[1]
    assert all(np.isfinite(trained.losses))
    untrained = initial_directed(recipe).state_dict()
    loaded = load_checkpoint(path).network.state_dict()
    assert any(not torch.equal(loaded[name], untrained[name]) for name in loaded)


def test_a_shape_with_another_sum_is_named(shapes, tmp_path):
    assert take_shapes(shapes, tmp_path / "copy") == (1, [])
    np.savez(shapes / "training" / "ball.npz", vertices=np.zeros((3, 3)), faces=[[0, 1, 2]])
    count, (wrong,) = take_shapes(shapes, tmp_path / "other")
    assert count == 0
    assert "ball" in wrong
    assert "another sum" in wrong


# --- commands -------------------------------------------------------------------------------------


def invoke(*arguments):
    return CliRunner().invoke(train.run.app, [*map(str, arguments)], catch_exceptions=False)


def test_no_command_trains_the_default_recipe_and_fewer_steps_are_on_the_checkpoint(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    quick = replace(paper(), steps=2)
    monkeypatch.setattr(train.fitting.command, "RECIPES", {"paper": lambda seed=0: quick})
    outcome = invoke()
    assert outcome.exit_code == 0
    for shown in ("2/2", "Distance RMSE", "Hausdorff", "Normal error", "95 % interval"):
        assert shown in outcome.output
    checkpoint = load_checkpoint(tmp_path / "build" / "checkpoints" / "paper.safetensors")
    assert checkpoint.recipe == quick
    assert set(checkpoint.metrics) == {"ridge-held-out"}
    assert invoke("train", "--steps", "1", "--output", tmp_path / "short").exit_code == 0
    assert load_checkpoint(tmp_path / "short").recipe == replace(quick, steps=1)


@pytest.mark.parametrize(
    "arguments", ["train --output", "certify --json", "reproduce headline --output"]
)
def test_what_cannot_be_written_is_told_before_the_work_begins(arguments, tmp_path, monkeypatch):
    monkeypatch.setattr(train.fitting.command, "fit", lambda *_: pytest.fail("it trains"))
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    outcome = invoke(*arguments.split(), blocked / "x")
    assert outcome.exit_code != 0
    assert str(blocked / "x") in outcome.output
    assert "a folder that can be written" in outcome.output


# One process for both scripts: what takes long is what both import.
AS_SCRIPTS = """
import runpy, sys
from contextlib import suppress
for folder in ("train", "export"):
    sys.path[0], sys.argv = folder, ["run.py", "--help"]
    with suppress(SystemExit):
        runpy.run_path(f"{folder}/run.py", run_name="__main__")
    print({"torch", "numba", "trimesh"} & set(sys.modules) or "imports nothing", folder)
"""


def test_scripts_run_from_the_repository_root_and_help_waits_for_no_command():
    command = [sys.executable, "-W", "error", "-c", AS_SCRIPTS]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Usage") == 2
    assert "imports nothing train" in done.stdout
    # It is of a shell's commands, and these are none.
    assert "completion" not in done.stdout
    for name in ("train", "shapes", "reproduce", "certify", "validate"):
        assert any(line.split()[1:2] == [name] for line in done.stdout.splitlines())
