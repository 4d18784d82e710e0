"""The model file's graph of a network of directed edges: an encoder, its rounds, and the heads."""

from export.onnx_graph import Graph, answers_info, array, rows_info, serialised, silu
from pns_common.model.card import ModelCard
from pns_common.model.session import networks
from train.models.directed import DirectedNet
from train.models.torch_model import layers_of


def directed_bytes(network: DirectedNet, card: ModelCard) -> bytes:
    """Return the model file; tied weights are written as the dense matrices that they make.

    Inputs and outputs are those of ``pns_common.model.session.networks``: each is a network of its
    own in one graph, and the operator passes messages between them.
    """
    graph, held = Graph(), networks(card)
    layers = layers_of(network, card)
    for each in held:
        graph.prefix = f"{each.given}_"
        value, own = each.given, layers[each.given]
        for index, (weight, bias) in enumerate(own):
            last = index == len(own) - 1
            if bias is None:
                read = weight.shape[1]
                sizes = graph.shape("sizes", [read, each.columns - read])
                parts = f"{each.given}_states", f"{each.given}_told"
                value, added = graph.split(value, sizes, parts)
            else:
                added = graph.constant(f"bias_{index}", array(bias))
            factors = value, graph.constant(f"weight_{index}", array(weight)), added
            value = graph.apply("Gemm", *factors, output=each.answer if last else "", transB=1)
            if not last:
                value = silu(graph, value)
    inputs = [rows_info(each.given, f"{each.given}_rows", each.columns) for each in held]
    outputs = [
        answers_info(each.answer, f"{each.given}_rows", each.answer_columns) for each in held
    ]
    return serialised(graph, inputs, outputs, card)
