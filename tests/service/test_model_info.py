"""`pns info`: the bundled models side by side, and a card with all that it holds."""

import copy
from dataclasses import replace

import pytest

from pns_common.model.file import DEFAULT_MODEL, load_model, model_from_bytes
from service.model_info import print_model, print_models
from tests.support.networks import default_model_bytes

METRIC = {"reference_mean": 0.5, "method_mean": 0.25, "percent": 50.0, "low": 4, "high": 6}
NESTED = {
    "ridge-held-out": {"distance_near": METRIC, "distance": METRIC},
    "decimation": {"meshes": 7, "mean": {"bunny": {"loop": 0.125}, "cow": {"loop": 0.0625}}},
    "jump": {"ridges": {"by level": [1.5, 1.25], "worst": {"value": 1.75}}},
    "margin": 0.375,
}


@pytest.fixture
def vertices():
    return model_from_bytes(default_model_bytes(0, gate_sharpness=40.0, budget=0.25), "vertices")


def with_card(model, name=None, **changes):
    other = copy.copy(model)
    other.card, other.name = replace(model.card, **changes), name or model.name
    return other


def test_models_are_compared_in_80_columns(capsys, monkeypatch, vertices):
    monkeypatch.setenv("COLUMNS", "80")
    long = with_card(vertices, "symmetric-signed", metrics=NESTED)
    print_models([load_model("paper"), long, vertices, load_model()])
    lines = capsys.readouterr().out.splitlines()
    assert all(len(line) <= 80 for line in lines)
    assert [line.split()[0] for line in lines if " * " in line] == [DEFAULT_MODEL]
    rows = {line.split()[0]: line.replace(" *", "").split()[1:] for line in lines[2:6]}
    percent = load_model("paper").card.metrics["ridge-held-out"]["distance_near"]["percent"]
    assert rows["paper"][:5] == ["paper-5", "first-face", "0.5", "10", f"{percent:+.1f}"]
    assert rows["vertices"] == ["directed-28", "symmetric", "0.25", "40", "–", "–", "–"]
    # A metric that the card does not hold is a dash beside those that it does.
    assert rows[long.name][4:] == ["+50.0", "+50.0", "–"]


def test_all_that_a_card_says_is_shown(capsys):
    model = load_model("general")
    print_model(model)
    shown = {line.strip("│┃ ") for line in capsys.readouterr().out.splitlines()}
    values = {tuple(part.strip() for part in line.split("│")) for line in shown if "│" in line}
    told = {row[0]: row[1] for row in values if len(row) == 2}
    assert told["fold angle θ"] == f"{model.card.fold_angle:g}"
    assert told["sharpness levels"] == str(model.card.sharpness_levels)
    fields = {name for name, value in vars(model.card).items() if value is not None}
    for name in fields - {"training", "metrics"}:
        assert any(label.startswith(name.replace("_", " ")) for label in told), name


def test_metrics_are_shown_however_deep_they_lie(capsys, vertices):
    print_model(with_card(vertices, metrics=NESTED, training={"stages": {"first": {"steps": 11}}}))
    shown = capsys.readouterr().out
    for value in ("0.25", "50", "0.125", "0.0625", "[1.5, 1.25]", "1.75", "0.375", "11"):
        assert value in shown
    for title in ("metrics: decimation: mean", "metrics: jump: ridges: worst", "training: stages"):
        assert title in shown
    assert "{" not in shown
