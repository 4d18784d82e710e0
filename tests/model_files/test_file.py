"""A file that breaks the contract is refused before onnxruntime sees it; the error says why."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from pns_common import ModelError
from pns_common.model import file as model_file
from pns_common.model.file import (
    BUNDLED,
    LARGEST_CALL,
    LARGEST_FILE,
    MOST_NODES,
    bundled_models,
    check_file,
    companion_of,
    load_model,
    model_from_bytes,
)
from pns_common.model.session import CHUNK_ROWS
from tests.support.networks import (
    CARD,
    DEFAULT_CARD,
    default_model_bytes,
    model_bytes,
    perceptron_bytes,
    random_layers,
)

GOOD = perceptron_bytes(random_layers(0))
node = helper.make_node
PASS = [node("Slice", ["features", "from", "to", "axis"], ["three"])]
CUT = {"from": np.array([0]), "to": np.array([3]), "axis": np.array([1])}
PLAIN = [*PASS, node("Mul", ["three", "budget"], ["correction"])]
# Columns that fill a call: two tensors of them and two of three columns, four bytes a number.
WIDEST = LARGEST_CALL // (4 * CHUNK_ROWS * 2) - 3


def refused(data):
    """The refusal of a file."""
    with pytest.raises(ModelError) as caught:
        check_file(data, "bad")
    assert caught.value.path == "bad"
    return caught.value


def changed(change, data=GOOD):
    """The bytes of a file after a change."""
    proto = onnx.load_from_string(data)
    change(proto)
    return proto.SerializeToString()


def card_text(card=CARD, **changes):
    return json.dumps(json.loads(card.to_json()) | changes)


def through(*nodes):
    """Nodes that lead from the first three features to the output."""
    return [*PASS, *nodes]


def test_a_good_file_gives_its_card():
    assert check_file(GOOD, "good") == CARD
    assert check_file(default_model_bytes(), "good") == DEFAULT_CARD


@pytest.mark.parametrize("data", [b"", b"not a model", GOOD[: len(GOOD) // 2], bytes(1000)])
def test_bytes_that_are_no_onnx_file_are_refused(data):
    assert refused(data).expected in ("an ONNX file", "one metadata entry pns_card")


@pytest.mark.parametrize(
    ("card", "says"),
    [
        (None, "0"),
        ("{", "Expecting"),
        (card_text(format=4), "format 4, which is not read any more"),
        (card_text(features="paper-9"), "features 'paper-9'"),
        (card_text(surprise=1), "unknown fields surprise"),
    ],
)
def test_a_wrong_card_is_named(card, says):
    assert says in refused(perceptron_bytes(random_layers(0), card=card)).found


def test_a_second_card_is_refused():
    def doubled(proto):
        proto.metadata_props.append(proto.metadata_props[0])

    assert refused(changed(doubled)).found == "2"


def test_a_file_too_large_is_not_read(tmp_path):
    path = tmp_path / "huge.onnx"
    with path.open("wb") as file:
        file.truncate(60 * 2**20)
    with pytest.raises(ModelError, match="bytes"):
        load_model(path)
    assert refused(bytes(LARGEST_FILE + 1)).expected == f"at most {LARGEST_FILE} bytes"


HOSTILE = """
import resource, sys
from pns_common import ModelError
from pns_common.model.file import LARGEST_FILE, check_file
import onnx
def varint(value):
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
before, field, size = peak(), sys.argv[1], LARGEST_FILE - 100
if field == "model":
    data = b"\\x72\\x00" * (size // 2)
else:
    data = bytes.fromhex(field) * (size // 2)
    data = b"\\x3a" + varint(len(data)) + data
try:
    check_file(data, "hostile")
except ModelError as error:
    print(peak() - before, error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is in KiB on Linux")
@pytest.mark.parametrize(
    "what",
    ["0a00", "2a00", "5a00", "6a00", "model"],
    ids=["nodes", "weights", "in", "info", "card"],
)
def test_a_file_of_empty_messages_takes_little_memory(what):
    """Two bytes of an empty message become hundreds once they are parsed."""
    done = subprocess.run(
        [sys.executable, "-c", HOSTILE, what], capture_output=True, text=True, check=True
    )
    mebibytes, said = done.stdout.split(" ", 1)
    assert int(mebibytes) < 400
    assert "expected" in said


def test_more_nodes_than_allowed_are_refused():
    # Parsing comes first, checking and running many nodes would take minutes.
    nodes = [node("Identity", ["features"], [f"copy{i}"]) for i in range(MOST_NODES)]
    error = refused(model_bytes([*PLAIN, *nodes], CUT))
    assert (error.expected, error.found) == (f"at most {MOST_NODES} nodes", str(MOST_NODES + 2))


@pytest.mark.parametrize("operator", ["Loop", "If", "Expand", "Tile", "RandomNormal", "Resize"])
def test_operators_off_the_list_are_refused_by_name(operator):
    data = model_bytes(through(node(operator, ["three"], ["correction"])), CUT)
    assert refused(data).found == operator


def test_operators_of_another_domain_are_refused_by_name():
    gelu = node("Gelu", ["three"], ["correction"], domain="com.microsoft")
    data = model_bytes(through(gelu), CUT, domains=["com.microsoft"])
    assert refused(data).found == "com.microsoft.Gelu"


def test_weights_outside_the_file_are_refused():
    def elsewhere(proto):
        weight = proto.graph.initializer[0]
        weight.ClearField("raw_data")
        weight.data_location = TensorProto.EXTERNAL
        weight.external_data.add(key="location", value="/etc/passwd")

    def beside(proto):
        proto.graph.initializer[0].external_data.add(key="location", value="weights.bin")

    assert refused(changed(elsewhere)).found == "external data"
    assert refused(changed(beside)).found == "external data"
    tensor = TensorProto(name="c", data_type=TensorProto.FLOAT, dims=[1])
    tensor.data_location = TensorProto.EXTERNAL
    nodes = through(
        node("Constant", [], ["c"], value=tensor), node("Mul", ["three", "c"], ["correction"])
    )
    assert refused(model_bytes(nodes, CUT)).found == "external data"


def test_graphs_beside_and_inside_the_graph_are_refused():
    inner = node("Identity", ["three"], ["correction"], body=helper.make_graph([], "in", [], []))
    assert "a graph in Identity" in refused(model_bytes(through(inner), CUT)).found
    assert "training" in refused(changed(lambda proto: proto.training_info.add())).found
    opset = [helper.make_opsetid("", 20)]
    body = [node("Neg", ["x"], ["y"])]
    function = helper.make_function("", "Abs", ["x"], ["y"], body, opset)
    assert "functions" in refused(changed(lambda proto: proto.functions.append(function))).found


def test_sparse_weights_are_refused():
    assert "sparse" in refused(changed(lambda proto: proto.graph.sparse_initializer.add())).found
    constant = node("Constant", [], ["c"], value_float=1.0)
    attribute = constant.attribute[0]
    attribute.Clear()
    attribute.name, attribute.type = "sparse_value", onnx.AttributeProto.SPARSE_TENSOR
    attribute.sparse_tensor.dims.append(1)
    nodes = through(constant, node("Identity", ["three"], ["correction"]))
    assert refused(model_bytes(nodes, CUT)).found == "a sparse tensor"


def test_what_onnx_itself_finds_invalid_is_refused_in_its_words():
    def reads_nothing(proto):
        proto.graph.node[0].input[0] = "nothing"

    error = refused(changed(reads_nothing))
    assert error.expected == "a valid ONNX model"
    assert "nothing" in error.found


@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [
        ([("features", ["edges", 6]), ("budget", [])], None),
        ([("features", ["edges", 5])], None),
        ([("features", ["edges", 5]), ("budget", [1])], None),
        ([("features", ["edges", 5]), ("budget", []), ("more", [])], None),
        (None, [("correction", ["edges", 4])]),
        (None, [("other", ["edges", 3])]),
    ],
)
def test_other_inputs_or_outputs_are_refused(inputs, outputs):
    name = outputs[0][0] if outputs else "correction"
    nodes = through(node("Identity", ["three"], [name]))
    assert "puts" in refused(model_bytes(nodes, CUT, inputs=inputs, outputs=outputs)).expected


def test_a_file_holds_the_networks_that_its_card_names():
    several, one = default_model_bytes(), perceptron_bytes(random_layers(0), card=DEFAULT_CARD)
    assert "messages_1" in refused(one).expected

    def as_paper(proto):
        proto.metadata_props[0].value = card_text(features="signed-18", orientation="symmetric")

    assert "messages_1" in refused(changed(as_paper, several)).found


def two_wide(width):
    """Two hidden tensors of so many columns."""
    nodes = [
        node("MatMul", ["features", "up"], ["wide"]),
        node("Tanh", ["wide"], ["bent"]),
        node("MatMul", ["bent", "down"], ["three"]),
        node("Mul", ["three", "budget"], ["correction"]),
    ]
    return model_bytes(nodes, {"up": np.zeros((5, width)), "down": np.zeros((width, 3))})


def doubled(source, axis, times):
    """Nodes that join a tensor to itself, again and again."""
    names = [source, *(f"twice{i}" for i in range(times))]
    return [node("Concat", [names[i]] * 2, [names[i + 1]], axis=axis) for i in range(times)]


def test_wide_layers_are_accepted_up_to_the_limit_and_no_further():
    assert check_file(two_wide(WIDEST), "wide") == CARD
    error = refused(two_wide(WIDEST + 1))
    assert error.expected == f"at most {LARGEST_CALL} bytes in one call"
    assert int(error.found) > LARGEST_CALL


@pytest.mark.parametrize(
    ("nodes", "weights"),
    [
        (doubled("features", 1, 40), {}),
        (doubled("seed", 0, 40), {"seed": np.zeros(2)}),
        (
            [
                node("Transpose", ["features"], ["columns"]),
                *doubled("columns", 1, 3),
                node("MatMul", ["features", "twice2"], ["product"]),
            ],
            {},
        ),
        (
            [node("Add", ["column", "row"], ["table"])],
            {"column": np.zeros((30_000, 1)), "row": np.zeros((1, 30_000))},
        ),
    ],
    ids=["rows", "constants", "product", "broadcast"],
)
def test_what_grows_inside_a_small_file_is_refused_before_it_does(nodes, weights):
    assert "bytes in one call" in refused(model_bytes([*PLAIN, *nodes], CUT | weights)).expected


def test_lengths_that_no_number_holds_are_refused():
    data = model_bytes([*PLAIN, *doubled("seed", 0, 70)], CUT | {"seed": np.zeros(2)})
    assert "fit together" in refused(data).expected


def test_a_shape_that_follows_from_values_is_refused_by_name():
    nodes = [
        *PASS,
        node("Cast", ["sizes"], ["shape"], to=TensorProto.INT64),
        node("Reshape", ["three", "shape"], ["rows"]),
        node("Mul", ["rows", "budget"], ["correction"]),
    ]
    error = refused(model_bytes(nodes, CUT | {"sizes": np.array([CHUNK_ROWS * 1.0, 3.0])}))
    assert (error.expected, error.found) == ("shapes that follow from the file", "rows")


def test_text_is_no_number():
    nodes = [*PLAIN, node("Cast", ["three"], ["words"], to=TensorProto.STRING)]
    assert refused(model_bytes(nodes, CUT)).found == "words"


def test_a_split_into_other_parts_than_its_outputs_is_refused():
    """onnxruntime would end the process."""
    nodes = [*PLAIN, node("Split", ["features"], ["a", "b", "c"], axis=1, num_outputs=2)]
    assert "fit together" in refused(model_bytes(nodes, CUT)).expected


def test_what_a_file_says_of_its_own_tensors_is_not_believed():
    small = helper.make_tensor_value_info("wide", TensorProto.FLOAT, [CHUNK_ROWS, 2])
    data = changed(lambda proto: proto.graph.value_info.append(small), two_wide(8 * WIDEST))
    assert "bytes in one call" in refused(data).expected

    def old(proto):
        # Before version 4 weights are inputs too, with a shape of their own.
        proto.ir_version = 3
        shapes = (("up", [5, 2]), ("down", [2, 3]))
        proto.graph.input.extend(
            helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in shapes
        )

    assert "bytes in one call" in refused(changed(old, two_wide(8 * WIDEST))).expected


def test_an_old_file_whose_weights_are_inputs_is_accepted():
    def old(proto):
        proto.ir_version = 3
        proto.graph.input.extend(
            helper.make_tensor_value_info(tensor.name, TensorProto.FLOAT, tensor.dims)
            for tensor in proto.graph.initializer
        )

    model = model_from_bytes(changed(old, two_wide(4)), "old")
    assert model.run("features", np.zeros((2, 5))).shape == (2, 3)


def test_answers_of_fewer_rows_are_refused():
    first = node("Slice", ["three", "from", "to", "first"], ["correction"])
    error = refused(model_bytes(through(first), CUT | {"first": np.array([0])}))
    assert (error.expected, error.found) == (f"correction of shape [{CHUNK_ROWS}, 3]", "[3, 3]")


def test_what_onnxruntime_cannot_run_is_refused_when_it_is_opened():
    """Allowed, valid, and the numbers are there: but not of this operator in this precision."""
    nodes = [
        node("Cast", ["three"], ["wide"], to=TensorProto.DOUBLE),
        node("Erf", ["wide"], ["made"]),
        node("Cast", ["made"], ["correction"], to=TensorProto.FLOAT),
    ]
    with pytest.raises(ModelError, match="Erf") as refusal:
        model_from_bytes(model_bytes(through(*nodes), CUT), "double")
    assert refusal.value.expected == "a graph that onnxruntime runs"


def test_a_bundled_name_wins_over_a_file_and_a_path_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paper").write_bytes(GOOD)
    ours = hashlib.sha256(GOOD).hexdigest()
    assert load_model("paper").hash != ours
    for path in ("./paper", tmp_path / "paper", Path("paper")):
        assert load_model(path).hash == ours


def test_a_file_is_called_by_its_stem(tmp_path):
    for file in ("mine.onnx", "mine"):
        path = tmp_path / file
        path.write_bytes(GOOD)
        model = load_model(str(path))
        assert (model.name, model.card, model.size) == ("mine", CARD, len(GOOD))


def test_a_file_that_is_not_there_lists_the_bundled_names():
    with pytest.raises(ModelError, match=r"bundled name \(.*paper") as caught:
        load_model("no/such/model.onnx")
    assert caught.value.path == "no/such/model.onnx"


def test_bundled_files_stay_below_half_the_limit_of_a_call(monkeypatch):
    monkeypatch.setattr(model_file, "LARGEST_CALL", LARGEST_CALL // 2)
    for name in bundled_models():
        check_file((BUNDLED / f"{name}.onnx").read_bytes(), name)


def test_a_companion_is_opened_once_on_the_same_providers():
    model = load_model()
    assert companion_of(model) is companion_of(load_model())
    assert companion_of(model).providers == model.providers
