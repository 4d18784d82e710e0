"""Loop's masks in torch, differentiable in points and in sharpness.

Written from the paper's equations 2 and 3 and the rules of Hoppe et al. 1994, not from
`pns_common`: tests hold its kernels against these.
"""

import math

import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.connectivity import Connectivity

EDGE_END, EDGE_OPPOSITE, MIDDLE = 3 / 8, 1 / 8, 1 / 2
CURVE_CENTRE, CURVE_SIDE = 3 / 4, 1 / 8


def loop_beta(valence: Int[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Return β_k = (5/8 − (3/8 + ¼ cos 2π/k)²) / k (equation 3); 0 for k = 0."""
    k = valence.clamp(min=1).double()
    beta = (5 / 8 - (3 / 8 + torch.cos(2 * math.pi / k) / 4) ** 2) / k
    return torch.where(valence > 0, beta, 0.0)


def loop_points(points: Float[Tensor, "V K"], mesh: Connectivity) -> Float[Tensor, "W K"]:
    """Return S_w p: old vertices first, then a vertex for each edge.

    Edge vertices are (1 − w) smooth + w middle; old ones (1 − w₂) smooth + (w₂ − w₃) curve + w₃ p.
    """
    count, own, beta = mesh.vertex_count, torch.arange(mesh.vertex_count), loop_beta(mesh.valence)
    (_, second, third), rims = mesh.sharpest[0].T, mesh.sharpest[1]
    smooth, curve = 1 - second, second - third
    centre = smooth * (1 - mesh.valence * beta) + curve * CURVE_CENTRE + third
    inserted, w, sides = count + torch.arange(len(mesh.edges)), mesh.sharpness, mesh.opposites
    # Row, column and weight of each entry of S_w; entries of one place add up.
    entries = [
        (own, own, centre),
        (mesh.centres, mesh.rims, (smooth * beta)[mesh.centres]),
        *((own, rims[:, side], curve * CURVE_SIDE) for side in (0, 1)),
        *((inserted, mesh.edges[:, k], (1 - w) * EDGE_END + w * MIDDLE) for k in (0, 1)),
        *((inserted, sides[:, k], (1 - w) * EDGE_OPPOSITE) for k in (0, 1)),
    ]
    rows, columns, weights = (torch.cat(parts) for parts in zip(*entries, strict=True))
    placed = points.new_zeros((count + len(mesh.edges), points.shape[1]))
    return placed.index_add(0, rows, weights[:, None] * points[columns])
