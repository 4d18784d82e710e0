"""Answers of a model depend on a row alone; a network that breaks is an error of the model."""

import os
import pickle
import subprocess
import sys
import threading
from functools import partial

import numpy as np
import pytest
from onnx import helper

from pns_common import ModelError, ParameterError
from pns_common.model.file import model_from_bytes
from pns_common.model.session import CHUNK_ROWS, CPU, Model, networks
from tests.support.networks import (
    HIDDEN,
    breaking_off_bytes,
    default_model,
    default_model_bytes,
    float64_network,
    model_bytes,
    perceptron_bytes,
    random_layers,
    random_model,
)

node = helper.make_node
CUT = {"from": np.array([0]), "to": np.array([3]), "axis": np.array([1])}
PASS = [node("Slice", ["features", "from", "to", "axis"], ["three"])]


def rows(count, width=5, seed=0):
    return np.random.default_rng(seed).uniform(-2, 2, (count, width))


@pytest.mark.parametrize("budget", [0.0, 0.5, 1e3])
def test_answers_are_those_of_the_network_in_double_precision(budget):
    features = rows(700)
    expected = budget * float64_network(random_layers(0))(features)
    answers = random_model(0).run("features", features, budget)
    assert answers.dtype == np.float32
    np.testing.assert_allclose(answers, expected, rtol=0, atol=2e-6 * budget)
    assert np.linalg.norm(answers, axis=1).max() <= budget * (1 + 1e-6)


def silu_network(layers):
    """A perceptron with x σ(x) between layers, in double precision."""

    def network(rows):
        for number, (weight, bias) in enumerate(layers):
            rows = rows @ weight + bias
            if number < len(layers) - 1:
                rows = rows / (1 + np.exp(-rows))
        return rows

    return network


def test_each_network_answers_its_own_rows():
    model = default_model(3)
    for number, held in enumerate(networks(model.card)):
        widths = [held.columns, *[HIDDEN] * (held.answer != "heads"), held.answer_columns]
        given = rows(50, held.columns)
        expected = silu_network(random_layers(3 + number, widths, 0.3))(given)
        np.testing.assert_allclose(model.run(held.given, given), expected, atol=1e-5)


def test_a_rows_bits_depend_on_nothing_but_the_row():
    """Not on how many rows there are, nor on where in a chunk it stands."""
    for model, given, width in (
        (random_model(0), "features", 5),
        (default_model(0), "messages_1", 28),
    ):
        features, ask = rows(2 * CHUNK_ROWS + 17, width), partial(model.run, given)
        whole = ask(features)
        for count in (1, 2, 3, 5, 8, 15, 16, 17, 31, 100, CHUNK_ROWS - 1, CHUNK_ROWS + 1):
            for start in (0, 1, CHUNK_ROWS - 3, len(features) - count):
                part = slice(start, start + count)
                np.testing.assert_array_equal(ask(features[part]), whole[part])
        assert len(ask(features[:0])) == 0


def test_each_thread_has_a_session_of_its_own_and_keeps_it():
    model, seen = random_model(0), {}

    def ask(number):
        sessions = [model._session() for _ in range(2)]
        seen[number] = sessions[0]
        assert sessions[0] is sessions[1]

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({id(session) for session in [*seen.values(), model._session()]}) == 4


@pytest.mark.parametrize(
    ("data", "width"),
    [(perceptron_bytes(random_layers(0)), 5), (default_model_bytes(), 28)],
    ids=["1", "5"],
)
def test_a_model_travels_to_another_process(data, width):
    model = model_from_bytes(data, "mine")
    copy = pickle.loads(pickle.dumps(model))
    assert isinstance(copy, Model)
    assert (copy.name, copy.hash, copy.card, copy.size, copy.providers) == (
        *("mine", model.hash, model.card, model.size, CPU),
    )
    features = rows(9, width)
    same = (each.run("features", features, 0.5) for each in (copy, model))
    np.testing.assert_array_equal(*same)


@pytest.mark.parametrize("shape", [(7, 4), (7, 1), (5,), (7, 5, 1)])
def test_features_of_another_shape_are_refused(shape):
    with pytest.raises(ParameterError, match=r"shape \(N, 5\)"):
        random_model(0).run("features", np.zeros(shape))


@pytest.mark.parametrize("providers", [(), ("NoSuchExecutionProvider",)])
def test_a_provider_that_is_not_there_is_refused(providers):
    with pytest.raises(ParameterError, match="CPUExecutionProvider"):
        model_from_bytes(perceptron_bytes(random_layers(0)), "mine", providers)


def test_answers_that_are_not_finite_are_refused():
    divide = node("Div", ["three", "zero"], ["correction"])
    model = model_from_bytes(model_bytes([*PASS, divide], CUT | {"zero": np.zeros(())}), "nan")
    with pytest.raises(ModelError, match="finite"):
        model.run("features", rows(3))


def test_a_graph_that_breaks_off_is_refused():
    with pytest.raises(ModelError, match="runs to its end"):
        model_from_bytes(breaking_off_bytes(), "breaks").run("features", rows(3))


def test_answers_of_another_shape_are_refused():
    """Of a chunk of CHUNK_ROWS the shape is right, of fewer rows it is not."""
    nodes = [
        *PASS,
        node("Concat", ["three"] * 16, ["wide"], axis=0),
        node("Slice", ["wide", "from", "rows", "first"], ["cut"]),
        node("Identity", ["cut"], ["correction"]),
    ]
    weights = CUT | {"rows": np.array([CHUNK_ROWS]), "first": np.array([0])}
    model = model_from_bytes(model_bytes(nodes, weights), "longer")
    assert model.run("features", rows(CHUNK_ROWS)).shape == (CHUNK_ROWS, 3)
    with pytest.raises(ModelError, match="a row for each"):
        model.run("features", rows(3))


def test_onnxruntime_is_imported_with_the_first_model():
    code = (
        "import sys, pns_common.model.file as f;"
        "assert not {'onnx', 'onnxruntime'} & set(sys.modules);"
        "f.load_model('paper'); assert 'onnxruntime' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_model_that_is_loaded_writes_nothing_of_its_user(tmp_path):
    """From 1.29 on onnxruntime identifies the machine and reports its use unless told not to."""
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    environment = {name: value for name, value in os.environ.items() if "TELEMETRY" not in name}
    command = [sys.executable, "-c", "import pns_common; pns_common.load_model()"]
    subprocess.run(command, env=environment | home, check=True)
    assert list(tmp_path.rglob("*")) == []
