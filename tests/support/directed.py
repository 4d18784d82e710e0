"""Model files of format 5 made in the tests, by a builder of their own, and their networks."""

import torch
from onnx import helper
from torch import nn

from pns_common.model.card import ModelCard
from pns_common.model.file import model_from_bytes
from pns_common.model.session import networks
from tests.support.networks import model_bytes
from train.models.directed import DirectedNet

WIDTH, HIDDEN, ROUNDS = 8, 12, 2
NUMBERS = {
    "gate_sharpness": 1e7,
    "vertex_gate_sharpness": 1e4,
    "budget": 10.0,
    "curve_strength": 1.0,
    "network_scale": 0.3,
    "fold_angle": 40.0,
}


def directed_card(base="loop", levels=2, **changes):
    """A card of format 5."""
    given = NUMBERS | changes
    return ModelCard(
        *(5, "directed-28", given["gate_sharpness"], given["budget"], "symmetric", {}, {}),
        base=base,
        vertex_gate_sharpness=given["vertex_gate_sharpness"],
        boundary_strength=given["curve_strength"],
        network_scale=given["network_scale"],
        fold_angle=given["fold_angle"],
        sharpness_levels=levels,
        width=WIDTH,
        rounds=ROUNDS,
    )


def random_network(seed, scale=0.3, *, faces=False):
    """A network with random weights, in double precision; the mirror ties them."""
    net = DirectedNet(torch.Generator().manual_seed(seed), WIDTH, HIDDEN, ROUNDS, faces=faces)
    generator = torch.Generator().manual_seed(seed + 1)
    with torch.no_grad():
        for weights in net.parameters():
            weights.copy_(scale * torch.randn(weights.shape, generator=generator))
    return net.double().requires_grad_(False)


def directed_bytes(network, card):
    """The file of a network: each part reads an input of its own."""
    nodes, weights = [], {}
    for each, part in zip(
        networks(card), (network.encoder, *network.rounds, network.heads), strict=True
    ):
        value, layers = (
            each.given,
            [each for each in part.modules() if isinstance(each, nn.Linear)],
        )
        for number, layer in enumerate(layers):
            last, name = number == len(layers) - 1, f"{each.given}_{number}"
            made = each.answer if last else f"{name}_sum"
            weights[f"{name}_weight"] = layer.weight.numpy().T
            weights[f"{name}_bias"] = layer.bias.numpy()
            given = [value, f"{name}_weight", f"{name}_bias"]
            nodes.append(helper.make_node("Gemm", given, [made]))
            if not last:
                nodes.append(helper.make_node("Sigmoid", [made], [f"{name}_gate"]))
                nodes.append(helper.make_node("Mul", [made, f"{name}_gate"], [f"{name}_silu"]))
                value = f"{name}_silu"
    inputs = [(each.given, [f"{each.given}_rows", each.columns]) for each in networks(card)]
    outputs = [
        (each.answer, [f"{each.given}_rows", each.answer_columns]) for each in networks(card)
    ]
    return model_bytes(nodes, weights, card=card, inputs=inputs, outputs=outputs, opset=17)


def directed_model_bytes(seed=0, scale=0.3, base="loop", **changes):
    """A file of format 5 with random weights."""
    network = random_network(seed, scale, faces=base != "loop")
    return directed_bytes(network, directed_card(base, **changes))


def directed_model(seed=0, scale=0.3, base="loop", **changes):
    """A model of format 5 with random weights."""
    return model_from_bytes(directed_model_bytes(seed, scale, base, **changes), "directed")
