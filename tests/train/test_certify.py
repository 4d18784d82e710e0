"""certify of whole model files, and the command."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import trimesh
from onnx import helper
from typer.testing import CliRunner

import train.run
from pns_common import loop, pns
from pns_common.model.file import load_model, model_from_bytes
from tests.support.control_points import refine
from tests.support.networks import (
    CARD,
    breaking_off_bytes,
    float64_network,
    model_bytes,
    perceptron_bytes,
    random_layers,
)
from train.certificates.bodies import real_bodies
from train.certificates.certify import certify_model_file
from train.certificates.double_precision import double_model
from train.certificates.model_file import keeps_its_word


def quiet(title, done, total):
    pass


def written(tmp_path, data):
    path = tmp_path / "model.onnx"
    path.write_bytes(data)
    return path


def failures(verdict):
    return {
        certificate.name: certificate.where
        for certificate in verdict.certificates
        if certificate.counts and not certificate.passed
    }


def nan_bytes():
    """A perceptron with a bias of NaN."""
    (weight, bias), *rest = random_layers(0)
    return perceptron_bytes([(weight, bias * np.nan), *rest])


def test_the_papers_model_passes():
    verdict = certify_model_file("paper", (), 0, quiet, valences=(3, 7))
    assert verdict.passed, failures(verdict)
    theorems = {certificate.theorem for certificate in verdict.certificates}
    assert theorems == {"file", "stars", *(f"T{number}" for number in range(1, 9))}


OTHER_SHAPES = model_bytes(
    [helper.make_node("Identity", ["features"], ["correction"])],
    {},
    outputs=[("correction", ["edges", 5])],
)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (nan_bytes(), {"the file keeps its word": "NaN", "bounded displacement": "NaN"}),
        (OTHER_SHAPES, {"the file keeps the contract": "outputs"}),
        (
            breaking_off_bytes(),
            {
                "the file keeps its word": "runs to its end",
                "proximity slope": "runs in double precision",
            },
        ),
        (None, {"the file keeps the contract": "model.onnx"}),
    ],
    ids=["NaN", "other shapes", "breaks off", "missing"],
)
def test_a_file_that_breaks_its_word_fails_by_name(tmp_path, data, expected):
    path = tmp_path / "model.onnx" if data is None else written(tmp_path, data)
    verdict = certify_model_file(path, (), 0, quiet, valences=(3,))
    assert not verdict.passed
    for name, reason in expected.items():
        assert reason in failures(verdict)[name]
    if len(expected) == 1:
        assert set(failures(verdict)) == set(expected)


def broken_words(data):
    model = model_from_bytes(data, "boasts")
    return {each.name for each in keeps_its_word(model) if not each.passed}


def test_answers_beyond_the_budget_and_metrics_that_do_not_come_out_fail_by_name():
    loud = perceptron_bytes(random_layers(0, scale=3.0), project=False)
    assert broken_words(loud) == {"corrections within the budget given"}
    for claim in ({"distance_near": {"percent": 50.0}}, {"distance_near": "a lot"}, "good"):
        card = replace(CARD, metrics={"ridge-held-out": claim})
        boasting = perceptron_bytes(random_layers(0), card=card)
        assert broken_words(boasting) == {"the card's metrics come out again"}


def test_double_precision_is_the_same_network():
    """Against a perceptron written in numpy; the file rounds what it reads to single."""
    layers = random_layers(0)
    data = perceptron_bytes(layers)
    double = double_model(model_from_bytes(data, "double"), data)
    layers = [(np.float32(weight), np.float32(bias)) for weight, bias in layers]
    rows = np.random.default_rng(1).standard_normal((50, 5))
    expected = 0.5 * float64_network(layers)(rows)
    np.testing.assert_allclose(double.run("features", rows, 0.5), expected, atol=1e-14)


def invoke(*arguments):
    command = ["certify", *map(str, arguments)]
    return CliRunner().invoke(train.run.app, command, catch_exceptions=False)


def test_the_command_passes_or_exits_with_failure_and_writes_json(tmp_path, monkeypatch):
    quicker = partial(certify_model_file, valences=(3,))
    monkeypatch.setattr("train.certificates.command.certify_model_file", quicker)
    verdict = tmp_path / "verdict.json"
    outcome = invoke(written(tmp_path, b"no model"), "--json", verdict)
    assert outcome.exit_code == 1
    assert "the file keeps the contract" in outcome.output
    assert json.loads(verdict.read_text())["passed"] is False
    sound = written(tmp_path, perceptron_bytes(random_layers(0)))
    outcome = invoke(sound, "--json", verdict)
    assert outcome.exit_code == 0, outcome.output
    assert "every certificate passed" in outcome.output
    assert json.loads(verdict.read_text())["passed"] is True


CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
QUADS = CUBE + "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def test_own_meshes_are_named_with_theorem_4_or_why_they_were_skipped(tmp_path):
    folder, path = tmp_path / "meshes", tmp_path / "verdict.json"
    folder.mkdir()
    (folder / "cube.obj").write_text(QUADS)
    made = trimesh.creation.torus(1, 0.4, major_sections=9, minor_sections=6)
    made.export(folder / "ring.ply")
    outcome = invoke("paper", "--only", "T4", "--meshes", folder, "--json", path)
    assert outcome.exit_code == 0, outcome.output
    words = " ".join(outcome.output.split())
    assert "skipped: has polygons" in words
    assert "They took part in T4." in words
    verdict = json.loads(path.read_text())
    assert {row["theorem"] for row in verdict["certificates"]} == {"T4"}
    cube, ring = verdict["meshes"]
    assert (cube["name"], cube["faces"], cube["proximity"]) == ("cube.obj", 6, None)
    # The same by arithmetic of its own, at the size that the mesh has.
    (body,) = (body for body in real_bodies(folder) if body.name == "ring.ply")
    mesh, scheme = body.mesh, pns(load_model("paper"))
    ours = refine(mesh, scheme, 1, 1.0, creases=None).mesh.vertices
    apart = np.linalg.norm(ours - loop().matrix(mesh) @ mesh.vertices, axis=1).max()
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    assert ring["proximity"] == pytest.approx(apart / (scheme.budget * longest**2), rel=1e-6)


def test_the_command_names_a_file_as_it_is_called():
    """Square brackets are markup to what prints."""
    outcome = invoke("a[/b].onnx")
    assert outcome.exit_code == 1
    assert outcome.output.strip().startswith("a[/b].onnx: no model: ")
    assert "nan" not in outcome.output


@pytest.mark.parametrize(
    ("arguments", "mesh", "says"),
    [
        ("paper --only T9", None, "T8"),
        ("none.onnx --json .", None, "directory"),
        ("--meshes .", None, "no .obj"),
        ("--meshes .", "v 0 0 0\n", "wrong.obj: "),
        ("--meshes .", "v 0 0\nf 1 1 1\n", "wrong.obj: "),
        ("--meshes .", "v 0 0 0\nf 1 2 9\n", "wrong.obj: "),
    ],
)
def test_what_cannot_be_certified_is_an_error_of_use(tmp_path, monkeypatch, arguments, mesh, says):
    monkeypatch.chdir(tmp_path)
    if mesh is not None:
        (tmp_path / "wrong.obj").write_text(mesh)
    outcome = invoke(*arguments.split())
    assert outcome.exit_code == 2
    assert says in outcome.output
