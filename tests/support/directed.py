"""Networks of directed edges whose weights the mirror ties, and their model files."""

from dataclasses import replace

import torch

from export.directed_graph import directed_bytes
from pns_common.model.file import model_from_bytes
from tests.support.networks import DEFAULT_CARD, HIDDEN
from train.models.directed import DirectedNet

NUMBERS = {
    "gate_sharpness": DEFAULT_CARD.gate_sharpness,
    "vertex_gate_sharpness": DEFAULT_CARD.vertex_gate_sharpness,
    "budget": DEFAULT_CARD.budget,
    "curve_strength": DEFAULT_CARD.boundary_strength,
    "network_scale": DEFAULT_CARD.network_scale,
    "fold_angle": DEFAULT_CARD.fold_angle,
}


def random_network(seed, scale=0.3, *, faces=False):
    """A network with random weights, in double precision; the mirror ties them."""
    shape = DEFAULT_CARD.width, HIDDEN, DEFAULT_CARD.rounds
    net = DirectedNet(torch.Generator().manual_seed(seed), *shape, faces=faces)
    generator = torch.Generator().manual_seed(seed + 1)
    with torch.no_grad():
        for weights in net.parameters():
            weights.copy_(scale * torch.randn(weights.shape, generator=generator))
    return net.double().requires_grad_(False)


def directed_model_bytes(seed=0, scale=0.3, base="loop", **changes):
    """A file of format 5 with random weights."""
    network = random_network(seed, scale, faces=base != "loop")
    return directed_bytes(network, replace(DEFAULT_CARD, base=base, **changes))


def directed_model(seed=0, scale=0.3, base="loop", **changes):
    """A model of format 5 with random weights."""
    return model_from_bytes(directed_model_bytes(seed, scale, base, **changes), "directed")
