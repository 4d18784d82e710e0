"""One training in place of several: asked, averaged, learned, and written down."""

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

import train.run
from pns_common import ParameterError
from train.data.pairs import pair_stream as stream
from train.data.primitives import box, globe, tetrahedron
from train.fitting import distillation
from train.fitting.distillation import Mean, asked, coarse_and_fine, distil, planned, regular_meshes
from train.models.checkpoint import Checkpoint, Distillation, load_checkpoint, save_checkpoint
from train.models.from_recipe import initial_network, initial_vertex_network
from train.models.recipe import VertexRule
from train.models.recipes import general, paper
from train.models.torch_model import recipe_model


def small(seed):
    rule = VertexRule("ring-10", hidden=(4,), gate_sharpness=1e4)
    return replace(general(seed), hidden=(16, 8), vertex=rule)


def training(recipe, loudness=0.6):
    """What a training might have made: last layers that say something."""
    networks = initial_network(recipe), initial_vertex_network(recipe)
    generator = torch.Generator().manual_seed(recipe.seed)
    for network in networks:
        last = network.linear_layers[-1]
        with torch.no_grad():
            last.weight = loudness * torch.randn(last.weight.shape, generator=generator)
    return Checkpoint(recipe, networks[0], {}, "machine", networks[1])


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Smaller steps, few regular meshes, and the stream without what takes long to make."""
    monkeypatch.setattr(distillation, "BATCH_ROWS", 512)
    monkeypatch.setattr(distillation, "REGULAR_ROWS", 500)
    monkeypatch.setattr(distillation, "regular_meshes", lambda: [tetrahedron(), box(), globe(6, 2)])
    shares = [0.0, 0.4, 0.4, 0.2, 0.0, 0.0, 0.0]
    monkeypatch.setattr(stream, "SHARES", dict(zip(stream.SHARES, shares, strict=True)))


MEMBERS = [training(small(seed)) for seed in (0, 1, 2)]


def test_the_mean_answers_as_all_do_and_stays_in_the_ball():
    models = [recipe_model(m.recipe, m.network, m.vertex_network) for m in MEMBERS]
    mean, rng = Mean(models), np.random.default_rng(0)
    for ask, width in (("__call__", 18), ("vertex_correction", 10)):
        rows = 3 * rng.standard_normal((50, width))
        said = np.array([getattr(model, ask)(rows, 0.5) for model in models])
        answer = getattr(mean, ask)(rows, 0.5)
        np.testing.assert_allclose(answer, said.mean(axis=0), atol=1e-7)
        assert np.linalg.norm(answer, axis=1).max() <= 0.5 * (1 + 1e-6)


def test_what_is_kept_are_rows_that_it_was_asked_with_their_answers():
    edges, vertices = asked(MEMBERS, islice(coarse_and_fine(5, 9), 4), seed=0)
    models = [recipe_model(m.recipe, m.network, m.vertex_network) for m in MEMBERS]
    assert len(edges.features) > len(vertices.features) > 20
    np.testing.assert_allclose(
        edges.answers, np.mean([model(edges.features, 1.0) for model in models], axis=0), atol=1e-6
    )
    again, _ = asked(MEMBERS, islice(coarse_and_fine(5, 9), 4), seed=0)
    np.testing.assert_array_equal(again.features, edges.features)


def test_meshes_are_coarse_ones_and_their_refinements():
    counts = [len(mesh.faces) for mesh in coarse_and_fine(1, 12)]
    assert 12 < len(counts) <= 24
    assert any(fine == 4 * coarse for coarse, fine in pairwise(counts))


def test_regular_meshes_count_as_much_as_others_though_their_rows_are_few():
    edges, vertices = asked(MEMBERS, [tetrahedron()], seed=0, repeated=50)
    for rows, few in ((edges, 6), (vertices, 4)):
        assert len(rows.features) == 50
        assert len(np.unique(rows.features.round(4), axis=0)) <= few
    counts = [len(mesh.faces) for mesh in regular_meshes()]
    assert min(counts) == 4
    assert max(counts) > 4000


def test_what_learns_comes_nearer_to_the_mean_than_any_member():
    losses = {}
    plan = planned(small(0), MEMBERS, meshes=6, steps=400)
    network, vertex_network = distil(small(0), MEMBERS, plan, losses.__setitem__)
    assert sorted(losses) == list(range(1, 801))
    edges, vertices = asked(MEMBERS, coarse_and_fine(0, 6), seed=0)
    for learned, members, rows in (
        (network, [m.network for m in MEMBERS], edges),
        (vertex_network, [m.vertex_network for m in MEMBERS], vertices),
    ):
        features, wanted = torch.from_numpy(rows.features), torch.from_numpy(rows.answers)
        with torch.no_grad():
            errors = [
                (each(features, 1.0) - wanted).square().mean() for each in (learned, *members)
            ]
        assert errors[0] < 0.7 * min(errors[1:])


def test_the_same_members_give_the_same_bits():
    plan = planned(small(0), MEMBERS, meshes=2, steps=3)
    first, again = (distil(small(0), MEMBERS, plan, lambda done, loss: None) for _ in range(2))
    for network, other in zip(first, again, strict=True):
        for name, tensor in network.state_dict().items():
            assert torch.equal(other.state_dict()[name], tensor)


def test_another_activation_learns_what_one_training_says():
    gelu = training(replace(small(0), activation="gelu"))
    plan = planned(small(0), [gelu], meshes=4, steps=200)
    assert (plan.seeds, plan.activations) == ((0,), ("gelu",))
    losses = {}
    network, _ = distil(small(0), [gelu], plan, losses.__setitem__)
    assert network.activation == "smoothstep"
    assert np.mean([losses[k] for k in range(180, 201)]) < 0.8 * np.mean([losses[1], losses[2]])


def test_trainings_of_another_recipe_or_the_same_twice_are_refused():
    louder = replace(MEMBERS[1], recipe=replace(MEMBERS[1].recipe, budget=3.0))
    for recipe, members, said in (
        (small(0), [MEMBERS[0], louder], "recipe"),
        (small(0), [MEMBERS[0], MEMBERS[0]], "trainings"),
        (paper(), [Checkpoint(paper(), initial_network(paper()), {}, "machine")], "scale-free"),
    ):
        with pytest.raises(ParameterError, match=said):
            planned(recipe, members, 1, 1)


def test_the_command_writes_a_checkpoint_that_says_what_it_was_made_of(tmp_path, monkeypatch):
    monkeypatch.setattr(train.run, "card_metrics", lambda recipe, scheme: {})
    monkeypatch.setattr(train.run, "RECIPES", {"general": small})
    paths = [tmp_path / f"{member.recipe.seed}.safetensors" for member in MEMBERS[:2]]
    for path, member in zip(paths, MEMBERS, strict=False):
        save_checkpoint(path, member)
    out = tmp_path / "made.safetensors"
    arguments = ["distil", *map(str, paths), "--meshes", "2", "--steps", "2", "--output", str(out)]
    outcome = CliRunner().invoke(train.run.app, arguments, catch_exceptions=False)
    assert outcome.exit_code == 0, outcome.output
    made = load_checkpoint(out)
    assert made.recipe == small(0)
    assert made.distilled == Distillation((0, 1), ("smoothstep",) * 2, 2, 2)


def test_what_cannot_be_distilled_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(train.run, "RECIPES", {"general": small})
    path, foreign = tmp_path / "a[b].safetensors", tmp_path / "foreign.safetensors"
    save_checkpoint(path, MEMBERS[0])
    before = path.read_bytes()
    save_checkpoint(foreign, training(replace(small(0), name="foreign")))
    for arguments, code, said in (
        ([path, path], 1, "expected different ones"),
        ([path, "--output", path], 1, "output = "),
        ([path, "--output", tmp_path], 2, "directory"),
        ([foreign], 1, "recipe = 'foreign': expected one of general"),
        ([tmp_path / "c[d]"], 1, "c[d]: expected a checkpoint, found no such file"),
    ):
        refused = CliRunner().invoke(train.run.app, ["distil", *map(str, arguments)])
        assert refused.exit_code == code, refused.output
        assert said in refused.output
    assert path.read_bytes() == before
