"""A model for polygons without training of its own: the prior, and another model's sharpness.

Its networks for corrections answer 0. How sharp an edge is, the sharpness network of a model of
triangles says, whose features are defined for polygons alike.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
from onnx import GraphProto, TensorProto, helper, numpy_helper
from onnx.utils import Extractor

from export.onnx_graph import IR_VERSION, OPSET
from pns_common.errors import ModelError
from pns_common.files import replace_file
from pns_common.model.card import CARD_KEY, DEFAULT_FORMAT, ModelCard
from pns_common.model.file import DEFAULT_MODEL, load_model, model_from_bytes
from pns_common.model.session import OnnxModel, networks

# Full quasi-interpolation over Catmull–Clark; all else as on the default model's card.
CARD = ModelCard(
    DEFAULT_FORMAT,
    "signed-18",
    gate_sharpness=1e7,
    budget=10.0,
    orientation="symmetric",
    training={"recipe": "prior alone, untrained; sharpness of another model"},
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
    sharpness_features="crease-53",
)


def write_prior_alone(path: Path, sharpness: Path | str = DEFAULT_MODEL) -> str:
    """Write a model file whose corrections are 0; return its hash.

    Args:
        path: the file to write.
        sharpness: the model, or its file, whose sharpness network is taken over.

    Raises:
        ModelError: the other model has no sharpness network, or the file would break the model
            contract; nothing is written.
    """
    other = load_model(sharpness)
    if other.card.sharpness_features != CARD.sharpness_features:
        expected = f"sharpness features {CARD.sharpness_features}"
        raise ModelError(other.name, expected=expected, found=str(other.card.sharpness_features))
    training = {**CARD.training, "sharpness": {"model": other.name, "sha256": other.hash}}
    card = replace(CARD, training=training)
    inputs = [helper.make_tensor_value_info("budget", TensorProto.FLOAT, [])]
    nodes, weights, outputs = [], [], []
    taken = sharpness_graph(other)
    inputs += taken.input
    nodes += taken.node
    weights += taken.initializer
    outputs += taken.output
    for network in networks(replace(card, sharpness_features=None)):
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


def sharpness_graph(model: OnnxModel) -> GraphProto:
    """Return the part of a model file that answers how sharp edges are."""
    whole = onnx.load_from_string(model.data)
    return Extractor(whole).extract_model(["sharpness_features"], ["sharpness"]).graph
