"""Networks: bounded for any weights, tied over symmetries, and read from files that are safe."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ModelError, pns
from pns_common.model.features import DIRECTED_28
from tests.support.control_points import refine
from tests.support.directed import random_network
from tests.support.meshes import bumpy_sphere, manifolds
from tests.support.polygons import correspondence, renumbered
from train.certificates.equivariance import well_conditioned
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.directed import MIRRORED
from train.models.from_recipe import initial_network
from train.models.networks import ACTIVATIONS, BoundedNet
from train.models.published import load_published
from train.models.recipes import paper, paper_text
from train.models.torch_model import recipe_model


@given(
    seed=st.integers(0, 2**31),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    budget=st.floats(1e-6, 1e6),
    activation=st.sampled_from(sorted(ACTIVATIONS)),
)
def test_output_stays_in_the_ball_for_any_weights(seed, scale, budget, activation):
    net = BoundedNet(5, (8, 8), activation, torch.Generator().manual_seed(seed)).double()
    features = torch.from_numpy(np.random.default_rng(seed).normal(size=(64, 5)) * 10)
    with torch.no_grad():
        for layer in net.linear_layers:
            layer.weight *= scale
        lengths = torch.linalg.vector_norm(net(features, budget), dim=-1)
    assert (lengths <= budget * (1 + 1e-12)).all()


EXACT = 1e-12


def model(features="paper-5", orientation="symmetric", seed=0):
    """A double precision model with loud random weights."""
    recipe = replace(paper(seed), features=features, orientation=orientation)
    network = initial_network(recipe).double()
    with torch.no_grad():
        for layer in network.linear_layers:
            layer.weight *= 3
    return recipe_model(recipe, network)


MIRROR = np.array([-1.0, 1, 1])


def apart(mesh, other, order, subject, flip=1.0):
    """Return how far another's refined vertices are from their places, where well defined."""
    wanted = refine(mesh, pns(subject), 1, 1.0).mesh.vertices * flip
    place = correspondence(mesh, other, order)[: len(wanted)]
    positions = refine(other, pns(subject), 1, 1.0).mesh.vertices[place]
    kept = np.ones(len(positions), dtype=bool)
    kept[len(mesh.vertices) :] = well_conditioned(mesh)
    return np.linalg.norm(positions - wanted, axis=1)[kept].max(initial=0)


def turned_over(mesh, flip=1.0):
    """The mesh with every face in the other direction, or mirrored; and v's numbers."""
    return Mesh(mesh.vertices * flip, mesh.faces[:, ::-1]), np.arange(len(mesh.vertices))


@pytest.mark.parametrize("features", ["paper-5", "signed-18"])
@given(mesh=manifolds(), seed=st.integers(0, 2**31))
def test_numbering_mirrors_and_turning_over_change_nothing_on_any_manifold(features, mesh, seed):
    subject = model(features)
    assert apart(mesh, *renumbered(mesh, seed), subject) < EXACT
    assert apart(mesh, *turned_over(mesh, MIRROR), subject, MIRROR) < EXACT
    if features == "signed-18":
        assert apart(mesh, *turned_over(mesh), subject) < EXACT


def test_the_papers_orientation_promises_none_of_this():
    mesh, subject = Mesh(*bumpy_sphere()), model(orientation="first-face")
    assert apart(mesh, *renumbered(mesh, 0), subject) > 1e-4
    assert apart(mesh, *turned_over(mesh, MIRROR), subject, MIRROR) > 1e-4


def test_the_mirror_exchanges_the_states_of_directed_edges_for_any_weights():
    """Features of the mirrored edge have the other half of each state; answers change signs."""
    group, network = DIRECTED_28.symmetries, random_network(3, 1.0, faces=True)
    rows = torch.from_numpy(np.random.default_rng(0).standard_normal((50, 28)))
    mirrored = rows[:, group.order[1]] * torch.from_numpy(group.signs[1])
    state, twin = network.encoder(rows), network.encoder(mirrored)
    torch.testing.assert_close(twin, state.roll(state.shape[1] // 2, 1), rtol=0, atol=1e-12)
    signs = torch.tensor((*MIRRORED, 1.0), dtype=torch.float64)
    answers = network.heads(state)
    torch.testing.assert_close(network.heads(twin), answers * signs, rtol=0, atol=1e-12)
    assert answers.abs().max() > 0.1


# --- files ----------------------------------------------------------------------------------------


def same(network, expected):
    return all(value.equal(expected[name]) for name, value in network.state_dict().items())


@pytest.mark.parametrize("recipe", [paper(7), paper_text(1)], ids=lambda recipe: recipe.name)
def test_a_checkpoint_keeps_everything_in_the_same_bytes(tmp_path, recipe):
    written = Checkpoint(recipe, initial_network(recipe), {"set": {"percent": 1.5}}, "machine")
    paths = [tmp_path / "deep" / name for name in ("one", "two")]
    for path in paths:
        save_checkpoint(path, written)
    read = load_checkpoint(paths[0])
    assert (read.recipe, read.metrics, read.machine) == (recipe, written.metrics, "machine")
    assert same(read.network, written.network.state_dict())
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert sorted(entry.name for entry in (tmp_path / "deep").iterdir()) == ["one", "two"]


def test_other_files_are_no_checkpoints(tmp_path):
    with pytest.raises(ModelError, match="no such file") as caught:
        load_checkpoint(tmp_path / "absent.safetensors")
    assert caught.value.path.endswith("absent.safetensors")
    torch.save(initial_network(paper()).state_dict(), tmp_path / "torch")
    safetensors.torch.save_file({"net.0.weight": torch.zeros(1)}, tmp_path / "bare")
    told = {"pns": '{"recipe": 3}'}
    safetensors.torch.save_file({"x": torch.zeros(1)}, tmp_path / "wrong", told)
    for name in ("torch", "bare", "wrong"):
        with pytest.raises(ModelError, match="safetensors with a recipe"):
            load_checkpoint(tmp_path / name)


def state(widths=(5, 8, 8, 3), seed=0):
    rng = np.random.default_rng(seed)
    tensors = {}
    for layer, (fan_in, fan_out) in enumerate(pairwise(widths)):
        for name, shape in (("weight", (fan_out, fan_in)), ("bias", (fan_out,))):
            values = rng.standard_normal(shape).astype(np.float32)
            tensors[f"net.{2 * layer}.{name}"] = torch.from_numpy(values)
    return tensors


def test_an_archive_and_a_clone_give_the_same_published_networks(tmp_path):
    expected = {"pns_a_C0.25": state(seed=1), "unconstrained": state((12, 8, 3), seed=2)}
    archive, clone = tmp_path / "archive", tmp_path / "clone" / "results" / "weights"
    archive.mkdir()
    clone.mkdir(parents=True)
    arrays = {f"{c}/{k}": v.numpy() for c, s in expected.items() for k, v in s.items()}
    np.savez(archive / "weights.npz", **arrays)
    torch.save(expected["pns_a_C0.25"], clone / "pns_a_C0.25.pt")
    nested = {f"model.{name}": value for name, value in expected["unconstrained"].items()}
    torch.save({"state_dict": nested, "C": 0.5}, clone / "unconstrained.pt")
    for folder in (archive, tmp_path / "clone"):
        networks = load_published(folder)
        assert set(networks) == set(expected)
        assert all(same(networks[name], expected[name]) for name in expected)


class Evil:
    def __reduce__(self):
        return Path.touch, (Path("pickled-code-ran"),)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "neither"),
        ({"net.0.weight": Evil()}, "weights only"),
        ([1, 2], r"other\.pt"),
        ({**state(), "net.2.weight": torch.zeros(3, 3)}, "state dictionary"),
    ],
)
def test_pickled_code_never_runs_and_files_without_weights_are_named(
    tmp_path, monkeypatch, content, says
):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        torch.save(content, tmp_path / "other.pt")
    with pytest.raises(ModelError, match=says):
        load_published(tmp_path)
    assert not Path("pickled-code-ran").exists()
