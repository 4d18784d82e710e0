"""One model in place of several: asked, averaged, learned, and written down."""

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

import train.run
from export.model_file import export_model
from pns_common import ParameterError
from train.data.pairs import pair_stream as stream
from train.data.primitives import box, globe, tetrahedron
from train.fitting import distillation
from train.fitting.distillation import (
    Mean,
    asked,
    coarse_and_fine,
    distil,
    load_teacher,
    planned,
    regular_meshes,
)
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


def as_model(checkpoint):
    return recipe_model(checkpoint.recipe, checkpoint.network, checkpoint.vertex_network)


MEMBERS = [training(small(seed)) for seed in (0, 1, 2)]
TEACHERS = [as_model(member) for member in MEMBERS]


def test_the_mean_answers_as_all_do_and_stays_in_the_ball():
    mean, rng = Mean(TEACHERS), np.random.default_rng(0)
    for ask, width in (("__call__", 18), ("vertex_correction", 10)):
        rows = 3 * rng.standard_normal((50, width))
        said = np.array([getattr(model, ask)(rows, 0.5) for model in TEACHERS])
        answer = getattr(mean, ask)(rows, 0.5)
        np.testing.assert_allclose(answer, said.mean(axis=0), atol=1e-7)
        assert np.linalg.norm(answer, axis=1).max() <= 0.5 * (1 + 1e-6)


def test_what_is_kept_are_rows_that_it_was_asked_with_their_answers():
    edges, vertices = asked(TEACHERS, islice(coarse_and_fine(5, 9), 4), seed=0)
    assert len(edges.features) > len(vertices.features) > 20
    np.testing.assert_allclose(
        edges.answers,
        np.mean([model(edges.features, 1.0) for model in TEACHERS], axis=0),
        atol=1e-6,
    )
    again, _ = asked(TEACHERS, islice(coarse_and_fine(5, 9), 4), seed=0)
    np.testing.assert_array_equal(again.features, edges.features)


def test_meshes_are_coarse_ones_and_their_refinements():
    counts = [len(mesh.faces) for mesh in coarse_and_fine(1, 12)]
    assert 12 < len(counts) <= 24
    assert any(fine == 4 * coarse for coarse, fine in pairwise(counts))


def test_regular_meshes_count_as_much_as_others_though_their_rows_are_few():
    edges, vertices = asked(TEACHERS, [tetrahedron()], seed=0, repeated=50)
    for rows, few in ((edges, 6), (vertices, 4)):
        assert len(rows.features) == 50
        assert len(np.unique(rows.features.round(4), axis=0)) <= few
    counts = [len(mesh.faces) for mesh in regular_meshes()]
    assert min(counts) == 4
    assert max(counts) > 4000


def test_what_learns_comes_nearer_to_the_mean_than_any_member():
    losses = {}
    plan = planned(small(0), TEACHERS, meshes=6, steps=400)
    network, vertex_network = distil(small(0), TEACHERS, plan, losses.__setitem__)
    assert sorted(losses) == list(range(1, 801))
    edges, vertices = asked(TEACHERS, coarse_and_fine(0, 6), seed=0)
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
    plan = planned(small(0), TEACHERS, meshes=2, steps=3)
    first, again = (distil(small(0), TEACHERS, plan, lambda done, loss: None) for _ in range(2))
    for network, other in zip(first, again, strict=True):
        for name, tensor in network.state_dict().items():
            assert torch.equal(other.state_dict()[name], tensor)


def test_another_activation_and_size_learn_what_one_teacher_says():
    wider = replace(small(0), hidden=(24, 24), activation="gelu")
    teacher = as_model(training(wider))
    plan = planned(small(0), [teacher], meshes=4, steps=200)
    losses = {}
    network, _ = distil(small(0), [teacher], plan, losses.__setitem__)
    assert (network.activation, network.linear_layers[0].out_features) == ("silu", 16)
    assert np.mean([losses[k] for k in range(180, 201)]) < 0.8 * np.mean([losses[1], losses[2]])


def test_rows_count_by_their_gates():
    """Where the gate is shut nothing is added, so what is said there is not learned."""
    rng = np.random.default_rng(0)
    features = rng.uniform(-0.5, 0.5, (4000, 18)).astype(np.float32)
    features[:, 0] = np.where(np.arange(4000) < 2000, 0.0, 1.0)
    answers = np.zeros((4000, 3), dtype=np.float32)
    answers[:2000, 1] = 0.9
    network = initial_network(small(0))
    rows = distillation.Answers(features, answers)
    for _ in distillation._steps(network, rows, lambda x: x, 60, seed=0):
        pass
    with torch.no_grad():
        assert network(torch.from_numpy(features[:2000]), 1.0).abs().max() < 0.1


def test_teachers_of_other_features_or_the_same_twice_are_refused():
    of_paper = recipe_model(paper(), initial_network(paper()))
    for recipe, teachers, said in (
        (small(0), [TEACHERS[0], of_paper], "reads signed-18 and ring-10"),
        (small(0), [TEACHERS[0], TEACHERS[0]], "different"),
        (paper(), [of_paper], "scale-free"),
    ):
        with pytest.raises(ParameterError, match=said):
            planned(recipe, teachers, 1, 1)


def test_a_model_file_teaches_as_its_checkpoint_does(tmp_path):
    save_checkpoint(tmp_path / "a.safetensors", MEMBERS[0])
    export_model(MEMBERS[0], tmp_path / "a.onnx")
    rows = np.random.default_rng(0).standard_normal((50, 18))
    file, checkpoint = (load_teacher(tmp_path / f"a.{end}") for end in ("onnx", "safetensors"))
    np.testing.assert_allclose(file(rows, 1.0), checkpoint(rows, 1.0), atol=1e-5)


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
    assert made.distilled == Distillation(tuple(each.hash for each in TEACHERS[:2]), 2, (2, 2))


def test_what_cannot_be_distilled_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(train.run, "RECIPES", {"general": small})
    path = tmp_path / "a[b].safetensors"
    save_checkpoint(path, MEMBERS[0])
    before = path.read_bytes()
    for arguments, code, said in (
        ([path, path], 1, "expected different ones"),
        ([path, "--output", path], 1, "output = "),
        ([path, "--output", tmp_path], 2, "directory"),
        ([tmp_path / "c[d].safetensors"], 1, "expected a checkpoint, found no such file"),
        ([tmp_path / "e.onnx"], 1, "expected a file or a bundled name"),
    ):
        refused = CliRunner().invoke(train.run.app, ["distil", *map(str, arguments)])
        assert refused.exit_code == code, refused.output
        assert said in refused.output
    assert path.read_bytes() == before
