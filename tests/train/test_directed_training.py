"""Training of networks of directed edges: what the product writes, to the byte."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import torch

from export.model_file import export_model
from pns_common import Mesh, load_model, loop, pns, refine
from train.data import pair_store, shape_library
from train.data.icosphere import icosphere
from train.data.shape_library import ListedShape, read_arrays, sum_of, take_shapes
from train.fitting.control_mesh import ControlMesh
from train.fitting.trainer import fit
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.from_recipe import initial_directed
from train.models.recipe import OnPairs, Recipe
from train.models.recipes import general

SPLITS, LEVELS = 4, 2


def shaken(splits: int) -> Mesh:
    """Return an open, uneven mesh of reference length about 1, with bends of all sizes."""
    mesh, rng = icosphere(splits), np.random.default_rng(5)
    points = mesh.vertices * [1, 0.8, 0.5] + 0.1 * rng.normal(size=mesh.vertices.shape)
    return Mesh(points, mesh.faces[: -len(mesh.faces) // 8])


def short_recipe() -> Recipe:
    """Return the recipe with two steps on few pairs."""
    made = general(3)
    assert isinstance(made.training, OnPairs)
    plan = msgspec.structs.replace(made.training, procedural=2, meshes=1, real=0.5)
    return replace(made, training=plan, steps=3)


@pytest.fixture
def shapes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with one training shape, which is all that the manifest lists."""
    sphere, folder = icosphere(SPLITS), tmp_path / "shapes"
    (folder / "training").mkdir(parents=True)
    np.savez(folder / "training" / "ball.npz", vertices=sphere.vertices, faces=sphere.faces)
    total = sum_of(read_arrays(folder / "training" / "ball.npz"))
    listed = ListedShape("ball", "training", "scan", "", "", "", "CC0", "", total)
    for module in (pair_store, shape_library):
        monkeypatch.setattr(module, "listed_shapes", lambda which=None: [listed])
    return folder


def test_the_limit_without_a_network_is_loops() -> None:
    mesh = shaken(2)
    form = general(0).directed
    assert form is not None
    made = ControlMesh(mesh, form).limit(None).points.numpy()
    assert np.abs(made - refine(mesh, loop(), LEVELS, limit=True).mesh.vertices).max() < 1e-12


def test_training_sees_what_the_model_file_writes(tmp_path: Path) -> None:
    mesh, recipe = shaken(2), general(0)
    assert recipe.directed is not None
    network = initial_directed(recipe)
    with torch.no_grad():
        generator = torch.Generator().manual_seed(1)
        for weights in network.parameters():
            weights += 0.2 * torch.randn(weights.shape, generator=generator)
    export_model(Checkpoint(recipe, network, {}, ""), tmp_path / "model.onnx")
    model = load_model(tmp_path / "model.onnx")
    made = ControlMesh(mesh, recipe.directed).limit(network)
    written = refine(mesh, pns(model), LEVELS, reference_length=1.0).mesh.vertices
    smooth = refine(mesh, loop(), LEVELS, reference_length=1.0).mesh.vertices
    assert np.abs(made.points.detach().numpy() - written).max() < 3e-6
    assert np.abs(written - smooth).max() > 1e-2


def test_the_same_recipe_gives_the_same_bytes(shapes: Path, tmp_path: Path) -> None:
    recipe, states = short_recipe(), []
    for name in ("first", "second"):
        trained = fit(recipe, lambda *_: None, (shapes, tmp_path / name))
        path = tmp_path / f"{name}.safetensors"
        save_checkpoint(path, Checkpoint(recipe, trained.network, {}, ""))
        states.append(path.read_bytes())
    assert states[0] == states[1]
    assert all(np.isfinite(trained.losses))
    untrained = initial_directed(recipe).state_dict()
    loaded = load_checkpoint(path).network.state_dict()
    assert any(not torch.equal(loaded[name], untrained[name]) for name in loaded)


def test_a_shape_with_another_sum_is_named(shapes: Path, tmp_path: Path) -> None:
    count, wrong = take_shapes(shapes, tmp_path / "copy")
    assert (count, wrong) == (1, [])
    np.savez(shapes / "training" / "ball.npz", vertices=np.zeros((3, 3)), faces=[[0, 1, 2]])
    count, wrong = take_shapes(shapes, tmp_path / "other")
    assert count == 0
    assert "ball" in wrong[0]
    assert "another sum" in wrong[0]
