"""Tied networks: proved before they are run, near every other runtime, symmetric to the bit."""

import hashlib

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from pns_common import Mesh, ModelError, load_model, pns, refine
from pns_common.fused import load_kernels
from pns_common.fused.learned import tied_network as compiled
from pns_common.models.tied_form import tied_form
from pns_common.runtimes.numpy_network import open_network
from pns_common.runtimes.onnx_model import bundled_models, installed_runtime, model_from_bytes
from pns_common.runtimes.onnx_session import open_session
from pns_common.runtimes.tied_network import TiedNetwork, arrays, open_tied_network
from pns_common.runtimes.tied_network.perceptron import Layer
from tests.support.meshes import bumpy_sphere
from tests.support.networks import float64_network, smoothstep
from tests.support.tied import EDGES, GROUPS, VERTICES, act, tied_bytes, tied_layers

COPIES = [(3,), (4, 4), (2, 3, 5)]
BYTES = tied_bytes(tied_layers(EDGES, (6, 6)), tied_layers(VERTICES, (16, 16), 1))


def form_of(group, copies, seed=0):
    form = tied_form([Layer(*layer) for layer in tied_layers(group, copies, seed)], group)
    assert form is not None
    return form


def rows_of(group, count=300, scale=1.0):
    return np.random.default_rng(7).uniform(-scale, scale, (count, group.order.shape[1]))


@pytest.fixture(params=["arrays", "kernel"])
def answers_of(request):
    if request.param == "arrays":
        return arrays.answers_of
    if not load_kernels():
        pytest.skip("no compiler for kernels")
    return compiled.answers_of


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("copies", COPIES)
def test_answers_are_the_dense_networks_to_single_precision(name, copies, answers_of):
    group = GROUPS[name]
    layers = [(weight.T, bias) for weight, bias in tied_layers(group, copies)]
    rows = rows_of(group).astype(np.float32)
    exact = float64_network(layers, smoothstep)(rows.astype(float))
    assert 0.02 < np.abs(exact).mean() < 0.6
    assert (
        np.abs(answers_of(form_of(group, copies), rows.astype(float), 0.5) - 0.5 * exact).max()
        <= 2e-6
    )


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("copies", COPIES)
def test_a_symmetry_of_the_features_turns_the_answer_to_the_last_bit(name, copies, answers_of):
    group, form = GROUPS[name], form_of(GROUPS[name], copies)
    rows = rows_of(group)
    answers = answers_of(form, rows, 1.0)
    for g, local in enumerate(group.local):
        turned = answers_of(form, act(group, g, rows), 1.0)
        np.testing.assert_array_equal(turned, answers * local)


@pytest.mark.parametrize("count", [0, 1, 127, 128, 129, 1025])
@pytest.mark.parametrize("name", GROUPS)
def test_the_kernel_has_the_bits_of_the_arrays(name, count):
    assert load_kernels()
    group, form = GROUPS[name], form_of(GROUPS[name], (2, 3, 5))
    for scale in (1e-30, 1.0, 30.0, 1e25):
        rows = rows_of(group, count, scale)
        here, there = (each.answers_of(form, rows, 0.7) for each in (arrays, compiled))
        assert (here.dtype, here.shape) == (there.dtype, there.shape) == (np.float32, (count, 3))
        assert here.tobytes() == there.tobytes()


def test_a_rows_bits_depend_on_nothing_but_the_row(answers_of):
    form, rows = form_of(EDGES, (6, 6)), rows_of(EDGES, 3000)
    together = answers_of(form, rows, 1.0)
    for some in (slice(0, 1), slice(120, 140), slice(1000, None)):
        np.testing.assert_array_equal(answers_of(form, rows[some], 1.0), together[some])


# Of networks and rows that numpy's generator gives on every machine.
DIGESTS = {"edges": "e2bc65213232e96e", "vertices": "0bcd032c3ddab080"}


@pytest.mark.parametrize("name", DIGESTS)
def test_the_bits_are_the_same_on_every_processor(name, answers_of):
    answers = answers_of(form_of(GROUPS[name], (6, 6)), rows_of(GROUPS[name], 200), 1.0)
    assert hashlib.sha256(answers.tobytes()).hexdigest()[:16] == DIGESTS[name]


def both_ways(model, rows, budget):
    return model(rows[0], budget), model.vertex_correction(rows[1], budget)


EXTREMES = {
    "ordinary": lambda shape, rng: rng.uniform(-2, 2, shape),
    "zeros": lambda shape, rng: np.zeros(shape),
    "denormal": lambda shape, rng: rng.uniform(-1e-40, 1e-40, shape),
    "large": lambda shape, rng: rng.uniform(-1e6, 1e6, shape),
    "huge": lambda shape, rng: rng.choice([-1e15, 1e15], shape),
    "mixed": lambda shape, rng: rng.uniform(-1, 1, shape) * 10.0 ** rng.integers(-30, 1, shape),
}


@pytest.mark.parametrize("runtime", [open_session, open_network])
@pytest.mark.parametrize("kind", EXTREMES)
def test_answers_are_every_other_runtimes_whatever_is_asked(kind, runtime):
    ours, theirs = model_from_bytes(BYTES, "ours"), model_from_bytes(BYTES, "theirs", runtime)
    rng = np.random.default_rng(3)
    rows = [EXTREMES[kind]((500, group.order.shape[1]), rng) for group in (EDGES, VERTICES)]
    for mine, other in zip(both_ways(ours, rows, 0.7), both_ways(theirs, rows, 0.7), strict=True):
        assert mine.dtype == other.dtype == np.float32
        assert np.isfinite(mine).all()
        # As far as the other two may differ (numpy_network/test_network.py).
        np.testing.assert_allclose(mine, other, rtol=0, atol=64 * 2.0**-24 * 0.7)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_makes_none_and_leaves_other_rows_alone(value, answers_of):
    form, rows = form_of(EDGES, (6, 6)), rows_of(EDGES)
    finite = answers_of(form, rows, 1.0)
    rows[5, 3] = value
    answers = answers_of(form, rows, 1.0)
    graph = model_from_bytes(BYTES, "graph", open_network)
    assert not np.isfinite(graph(rows, 1.0)[5]).any()
    assert not np.isfinite(answers[5]).any()
    others = np.arange(len(rows)) != 5
    np.testing.assert_array_equal(answers[others], finite[others])


def test_the_activation_is_exact_to_single_precision_and_ends_exactly():
    x = np.linspace(-5, 5, 40_001, dtype=np.float32)[None, None]
    t = np.clip(x.ravel().astype(float), -2, 2)
    exact = x.ravel() * (1 / 2 + 3 / 8 * t - t**3 / 32)
    made = arrays.smoothstep(x).ravel()
    assert (np.abs(made - exact) / np.maximum(1, np.abs(x.ravel()))).max() <= 2.0**-23
    far = np.abs(x.ravel()) >= 2
    np.testing.assert_array_equal(made[far], np.maximum(x.ravel()[far], 0))
    ends = np.array([[[np.inf, -np.inf, np.nan]]], dtype=np.float32)
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(arrays.smoothstep(ends).ravel(), [np.inf, np.nan, np.nan])


def test_the_default_model_is_run_by_this_program_and_the_others_by_what_is_installed():
    for name in bundled_models():
        tied = isinstance(load_model(name)._network, TiedNetwork)
        assert tied == (name == "general")


def changed(name, change):
    """The file with another value of a weight."""
    proto = onnx.load_from_string(BYTES)
    (weight,) = [each for each in proto.graph.initializer if each.name == name]
    values = numpy_helper.to_array(weight).copy()
    change(values)
    weight.CopyFrom(numpy_helper.from_array(values, name))
    return proto.SerializeToString()


def by_an_ulp(values):
    values.flat[0] = np.nextafter(values.flat[0], np.float32(9))


WEIGHTS = [f"{prefix}{kind}{i}" for prefix in ("", "vertex_") for kind in "wb" for i in range(3)]


@pytest.mark.parametrize("name", WEIGHTS)
def test_a_weight_that_differs_in_its_last_bit_is_not_tied(name):
    assert open_tied_network(BYTES, "tied") is not None
    data = changed(name, by_an_ulp)
    assert open_tied_network(data, "other") is None
    rows = rows_of(EDGES, 9)
    loaded = model_from_bytes(data, "other")
    by_graph = model_from_bytes(data, "other", installed_runtime())
    np.testing.assert_array_equal(loaded(rows, 1.0), by_graph(rows, 1.0))


NUMBERS = ["minus_two", "two", "fall", "slope", "half", "least", "vertex_slope"]


@pytest.mark.parametrize("name", NUMBERS)
def test_another_number_is_another_network(name):
    assert open_tied_network(changed(name, by_an_ulp), "other") is None


OTHERWISE = [
    ("Mul", "Add"), ("Max", "Min"), ("Clip", "Sum"), ("Sub", "Add"), ("Add", "Max"), ("Div", "Mul"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new"), OTHERWISE)
def test_another_operator_is_another_network(old, new):
    proto = onnx.load_from_string(BYTES)
    next(node for node in proto.graph.node if node.op_type == old).op_type = new
    assert open_tied_network(proto.SerializeToString(), "other") is None


def test_weights_that_are_no_numbers_are_not_tied():
    data = changed("w1", lambda values: values.fill(np.inf))
    assert open_tied_network(data, "other") is None


def test_what_is_no_model_is_refused_as_by_the_installed_runtime():
    for data in (b"", b"no model", BYTES[:1000]):
        assert open_tied_network(data, "bad") is None
        errors = []
        for runtime in (None, installed_runtime()):
            with pytest.raises(ModelError) as caught:
                model_from_bytes(data, "bad", runtime)
            errors.append(str(caught.value))
        assert errors[0] == errors[1]


def test_rows_of_another_length_are_an_error_of_the_model():
    model = model_from_bytes(BYTES, "tied")
    with pytest.raises(ModelError, match="runs to its end"):
        model(np.zeros((4, 17)), 1.0)
    with pytest.raises(ModelError, match="runs to its end"):
        model.vertex_correction(np.zeros((4, 18)), 1.0)


def test_positions_are_every_other_runtimes_to_single_precision():
    mesh = Mesh(*bumpy_sphere())
    made, *others = (
        refine(mesh, pns(model_from_bytes(BYTES, "m", runtime)))
        for runtime in (None, open_session, open_network)
    )
    assert made.ratio.max() > 0.01
    for other in others:
        length = made.report["reference_length"]
        assert np.abs(made.mesh.vertices - other.mesh.vertices).max() <= 1e-6 * length
