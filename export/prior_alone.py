"""A model without training: networks that answer 0, so that the prior acts alone."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from export.onnx_graph import IR_VERSION, OPSET
from pns_common.files import replace_file
from pns_common.model.card import CARD_KEY, DEFAULT_FORMAT, ModelCard
from pns_common.model.file import model_from_bytes
from pns_common.model.session import networks

# Full quasi-interpolation over Catmull–Clark; all else as on the default model's card.
CARD = ModelCard(
    DEFAULT_FORMAT,
    "signed-18",
    gate_sharpness=1e7,
    budget=10.0,
    orientation="symmetric",
    training={"recipe": "prior alone, untrained"},
    metrics={},
    base="catmull-clark",
    vertex_features="ring-10",
    vertex_gate_sharpness=1e4,
    prior_strength=1.0,
    boundary_strength=1.0,
    network_scale=0.4,
    fold_angle=75.0,
    sharpness_levels=2,
    face_features="face-8",
)


def write_prior_alone(path: Path, card: ModelCard = CARD) -> str:
    """Write a model file whose networks answer 0; return its hash.

    Raises:
        ModelError: the file would break the model contract; nothing is written.
    """
    inputs = [helper.make_tensor_value_info("budget", TensorProto.FLOAT, [])]
    nodes, weights, outputs = [], [], []
    for network in networks(card):
        name, rows = f"{network.given}_weights", f"{network.given}_rows"
        zeros = np.zeros((network.columns, network.answer_columns), dtype=np.float32)
        weights.append(numpy_helper.from_array(zeros, name))
        product = f"{network.answer}_of_one"
        nodes.append(helper.make_node("MatMul", [network.given, name], [product]))
        nodes.append(helper.make_node("Mul", [product, "budget"], [network.answer]))
        sizes = (network.given, network.columns), (network.answer, network.answer_columns)
        for values, (given, width) in zip((inputs, outputs), sizes, strict=True):
            values.append(helper.make_tensor_value_info(given, TensorProto.FLOAT, [rows, width]))
    model = helper.make_model(
        helper.make_graph(nodes, "pns", inputs, outputs, initializer=weights),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="pns",
    )
    helper.set_model_props(model, {CARD_KEY: card.to_json()})
    onnx.checker.check_model(model, full_check=True)
    data = model.SerializeToString(deterministic=True)
    digest = model_from_bytes(data, path.stem).hash
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)
    return digest
