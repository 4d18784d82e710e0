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


def carded(card=CARD, **changes):
    """A good file with another card."""
    text = json.dumps(json.loads(card.to_json()) | changes) if changes else card
    return perceptron_bytes(random_layers(0), card=text)


def through(*nodes, **options):
    """A file with nodes that lead from the first three features to the output."""
    return model_bytes([*PASS, *nodes], CUT, **options)


def beside(*nodes, **weights):
    """A good file with more nodes."""
    return model_bytes([*PLAIN, *nodes], CUT | weights)


def puts(inputs=None, outputs=None):
    """A file of these inputs and outputs."""
    name = outputs[0][0] if outputs else "correction"
    return through(node("Identity", ["three"], [name]), inputs=inputs, outputs=outputs)


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


def as_version_3(proto, shapes=None):
    """Before version 4 weights are inputs too, with a shape of their own."""
    proto.ir_version = 3
    for tensor in proto.graph.initializer:
        shape = (shapes or {}).get(tensor.name, tensor.dims)
        own = helper.make_tensor_value_info(tensor.name, TensorProto.FLOAT, shape)
        proto.graph.input.append(own)


def elsewhere(proto):
    weight = proto.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = TensorProto.EXTERNAL
    weight.external_data.add(key="location", value="/etc/passwd")


def constant_elsewhere():
    tensor = TensorProto(name="c", data_type=TensorProto.FLOAT, dims=[1])
    tensor.data_location = TensorProto.EXTERNAL
    read = node("Mul", ["three", "c"], ["correction"])
    return through(node("Constant", [], ["c"], value=tensor), read)


def sparse_constant():
    constant = node("Constant", [], ["c"], value_float=1.0)
    attribute = constant.attribute[0]
    attribute.Clear()
    attribute.name, attribute.type = "sparse_value", onnx.AttributeProto.SPARSE_TENSOR
    attribute.sparse_tensor.dims.append(1)
    return through(constant, node("Identity", ["three"], ["correction"]))


def small_say(proto):
    said = helper.make_tensor_value_info("wide", TensorProto.FLOAT, [CHUNK_ROWS, 2])
    proto.graph.value_info.append(said)


def as_paper(proto):
    card = carded(features="signed-18", orientation="symmetric")
    proto.metadata_props[0].value = onnx.load_from_string(card).metadata_props[0].value


FUNCTION = helper.make_function(
    *("", "Abs", ["x"], ["y"], [node("Neg", ["x"], ["y"])], [helper.make_opsetid("", 20)])
)
INNER = node("Identity", ["three"], ["correction"], body=helper.make_graph([], "in", [], []))
GELU = node("Gelu", ["three"], ["correction"], domain="com.microsoft")
FEATURES, BUDGET = ("features", ["edges", 5]), ("budget", [])
ONE_CALL = f"at most {LARGEST_CALL} bytes in one call"
FOLLOWS = [
    node("Cast", ["sizes"], ["shape"], to=TensorProto.INT64),
    node("Reshape", ["three", "shape"], ["rows"]),
    node("Mul", ["rows", "budget"], ["correction"]),
]
REFUSED = {
    "nothing": (b"", "one metadata entry pns_card"),
    "no model": (b"not a model", "an ONNX file"),
    "half a file": (GOOD[: len(GOOD) // 2], "an ONNX file"),
    "zeros": (bytes(1000), "an ONNX file"),
    "no card": (carded(None), "pns_card, found 0"),
    "two cards": (
        changed(lambda proto: proto.metadata_props.append(proto.metadata_props[0])),
        "pns_card, found 2",
    ),
    "a card that is no JSON": (carded("{"), "Expecting"),
    "a card of a retired format": (carded(format=4), "format 4, which is not read any more"),
    "features that nobody knows": (carded(features="paper-9"), "features 'paper-9'"),
    "a field that nobody knows": (carded(surprise=1), "unknown fields surprise"),
    # Parsing comes first, checking and running many nodes would take minutes.
    "many nodes": (
        beside(*(node("Identity", ["features"], [f"copy{i}"]) for i in range(MOST_NODES))),
        f"at most {MOST_NODES} nodes, found {MOST_NODES + 2}",
    ),
    **{
        operator: (through(node(operator, ["three"], ["correction"])), f"found {operator}")
        for operator in ("Loop", "If", "Expand", "Tile", "RandomNormal", "Resize")
    },
    "another domain": (through(GELU, domains=["com.microsoft"]), "found com.microsoft.Gelu"),
    "weights in another file": (changed(elsewhere), "found external data"),
    "weights beside themselves": (
        changed(lambda proto: proto.graph.initializer[0].external_data.add(key="location")),
        "found external data",
    ),
    "a constant in another file": (constant_elsewhere(), "found external data"),
    "a graph in a node": (through(INNER), "a graph in Identity"),
    "a graph of training": (changed(lambda proto: proto.training_info.add()), "training"),
    "a function": (changed(lambda proto: proto.functions.append(FUNCTION)), "functions"),
    "sparse weights": (changed(lambda proto: proto.graph.sparse_initializer.add()), "sparse"),
    "a sparse constant": (sparse_constant(), "found a sparse tensor"),
    "an input that is not there": (
        changed(lambda proto: proto.graph.node[0].input.__setitem__(0, "nothing")),
        "a valid ONNX model, found ",
    ),
    "six features": (puts([("features", ["edges", 6]), BUDGET]), "puts"),
    "no budget": (puts([FEATURES]), "puts"),
    "a list of budgets": (puts([FEATURES, ("budget", [1])]), "puts"),
    "a third input": (puts([FEATURES, BUDGET, ("more", [])]), "puts"),
    "corrections of four numbers": (puts(outputs=[("correction", ["edges", 4])]), "puts"),
    "another output": (puts(outputs=[("other", ["edges", 3])]), "puts"),
    "a card of more networks": (carded(DEFAULT_CARD), "messages_1"),
    "a card of fewer networks": (changed(as_paper, default_model_bytes()), "messages_1"),
    "a layer too wide": (two_wide(WIDEST + 1), ONE_CALL),
    # What grows inside a small file is refused before it does.
    "rows again and again": (beside(*doubled("features", 1, 40)), ONE_CALL),
    "constants again and again": (beside(*doubled("seed", 0, 40), seed=np.zeros(2)), ONE_CALL),
    "a product": (
        beside(
            node("Transpose", ["features"], ["columns"]),
            *doubled("columns", 1, 3),
            node("MatMul", ["features", "twice2"], ["product"]),
        ),
        ONE_CALL,
    ),
    "a broadcast": (
        beside(
            node("Add", ["column", "row"], ["table"]),
            column=np.zeros((30_000, 1)),
            row=np.zeros((1, 30_000)),
        ),
        ONE_CALL,
    ),
    # What a file says of its own tensors is not believed.
    "a small shape that is said": (changed(small_say, two_wide(8 * WIDEST)), ONE_CALL),
    "a small shape of an input": (
        changed(lambda p: as_version_3(p, {"up": [5, 2], "down": [2, 3]}), two_wide(8 * WIDEST)),
        ONE_CALL,
    ),
    "lengths that no number holds": (
        beside(*doubled("seed", 0, 70), seed=np.zeros(2)),
        "fit together",
    ),
    # onnxruntime would end the process.
    "a split into other parts": (
        beside(node("Split", ["features"], ["a", "b", "c"], axis=1, num_outputs=2)),
        "fit together",
    ),
    "a shape that follows from values": (
        model_bytes([*PASS, *FOLLOWS], CUT | {"sizes": np.array([CHUNK_ROWS * 1.0, 3.0])}),
        "shapes that follow from the file, found rows",
    ),
    "text": (beside(node("Cast", ["three"], ["words"], to=TensorProto.STRING)), "found words"),
    "fewer rows": (
        model_bytes(
            [*PASS, node("Slice", ["three", "from", "to", "first"], ["correction"])],
            CUT | {"first": np.array([0])},
        ),
        f"correction of shape [{CHUNK_ROWS}, 3], found [3, 3]",
    ),
}


@pytest.mark.parametrize(("data", "says"), REFUSED.values(), ids=REFUSED)
def test_a_file_that_breaks_the_contract_is_refused_in_words(data, says):
    assert says in str(refused(data))


def test_a_good_file_gives_its_card():
    assert check_file(GOOD, "good") == CARD
    assert check_file(default_model_bytes(), "good") == DEFAULT_CARD
    assert check_file(two_wide(WIDEST), "wide") == CARD


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


def test_an_old_file_whose_weights_are_inputs_is_accepted():
    model = model_from_bytes(changed(as_version_3, two_wide(4)), "old")
    assert model.run("features", np.zeros((2, 5))).shape == (2, 3)


def test_what_onnxruntime_cannot_run_is_refused_when_it_is_opened():
    """Allowed, valid, and the numbers are there: but not of this operator in this precision."""
    nodes = [
        node("Cast", ["three"], ["wide"], to=TensorProto.DOUBLE),
        node("Erf", ["wide"], ["made"]),
        node("Cast", ["made"], ["correction"], to=TensorProto.FLOAT),
    ]
    with pytest.raises(ModelError, match="Erf") as refusal:
        model_from_bytes(through(*nodes), "double")
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
