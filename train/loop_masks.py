"""Loop's masks as sparse matrices, differentiable in sharpness.

Written from the paper's equations 2 and 3 and the rules of Hoppe et al. 1994, not from
`pns_common`: tests hold its kernels against these, training takes its limits by them.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.connectivity import Connectivity

EDGE_END, EDGE_OPPOSITE, MIDDLE = 3 / 8, 1 / 8, 1 / 2
CURVE_CENTRE, CURVE_SIDE = 3 / 4, 1 / 8
LIMIT_CENTRE, LIMIT_SIDE = 2 / 3, 1 / 6


@dataclass(frozen=True, eq=False)
class Mask:
    """A sparse matrix by its entries, differentiable in its weights and in what it is applied to.

    Attributes:
        shape: rows, columns.
        rows, columns, weights: of each entry; entries of one place add up.
    """

    shape: tuple[int, int]
    rows: Int[Tensor, " N"]
    columns: Int[Tensor, " N"]
    weights: Float[Tensor, " N"]

    def __call__(self, points: Float[Tensor, "V K"]) -> Float[Tensor, "W K"]:
        """Apply the mask."""
        made = points.new_zeros((self.shape[0], points.shape[1]))
        return made.index_add(0, self.rows, self.weights[:, None] * points[self.columns])

    def matrix(self) -> sparse.csr_array:
        """Return the mask as a matrix without gradient."""
        place = (self.rows.numpy(), self.columns.numpy())
        return sparse.csr_array((self.weights.detach().numpy(), place), shape=self.shape)


def _mask(
    shape: tuple[int, int], *entries: tuple[Int[Tensor, " N"], Int[Tensor, " N"], Tensor | float]
) -> Mask:
    rows, columns = torch.cat([e[0] for e in entries]), torch.cat([e[1] for e in entries])
    weights = [torch.as_tensor(w, dtype=torch.float64).expand(len(r)) for r, _, w in entries]
    return Mask(shape, rows, columns, torch.cat(weights))


def loop_beta(valence: Int[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Return β_k = (5/8 − (3/8 + ¼ cos 2π/k)²) / k (equation 3); 0 for k = 0."""
    k = valence.clamp(min=1).double()
    beta = (5 / 8 - (3 / 8 + torch.cos(2 * math.pi / k) / 4) ** 2) / k
    return torch.where(valence > 0, beta, 0.0)


def limit_weight(valence: Int[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Return w_k = 1 / (1 + 3 / (8 k β_k)), the neighbours' weight in Loop's limit."""
    ring = valence * loop_beta(valence)
    return ring / (ring + 3 / 8)


def loop_mask(mesh: Connectivity) -> Mask:
    """Return S_w: old vertices first, then a vertex for each edge.

    Edge vertices are (1 − w) smooth + w middle; old ones (1 − w₂) smooth + (w₂ − w₃) curve + w₃ p.
    """
    count, own, beta = mesh.vertex_count, torch.arange(mesh.vertex_count), loop_beta(mesh.valence)
    (_, second, third), rims = mesh.sharpest[0].T, mesh.sharpest[1]
    smooth, curve = 1 - second, second - third
    centre = smooth * (1 - mesh.valence * beta) + curve * CURVE_CENTRE + third
    inserted, w, sides = count + torch.arange(len(mesh.edges)), mesh.sharpness, mesh.opposites
    return _mask(
        (count + len(mesh.edges), count),
        (own, own, centre),
        (mesh.centres, mesh.rims, (smooth * beta)[mesh.centres]),
        *((own, rims[:, side], curve * CURVE_SIDE) for side in (0, 1)),
        *((inserted, mesh.edges[:, k], (1 - w) * EDGE_END + w * MIDDLE) for k in (0, 1)),
        *((inserted, sides[:, k], (1 - w) * EDGE_OPPOSITE) for k in (0, 1)),
    )


def limit_mask(mesh: Connectivity) -> Mask:
    """Return Loop's limit positions, of edges that are smooth (w < ½) or sharp for good."""
    count, own = mesh.vertex_count, torch.arange(mesh.vertex_count)
    sharp = torch.bincount(mesh.edges[mesh.sharpness >= 1 / 2].reshape(-1), minlength=count)
    pull, rims = limit_weight(mesh.valence), mesh.sharpest[1]
    smooth, curve, stays = (kind.double() for kind in (sharp == 0, sharp == 2, sharp > 2))
    share = smooth * pull / mesh.valence.clamp(min=1)
    entries = [(own, own, smooth * (1 - pull) + curve * LIMIT_CENTRE + stays)]
    entries += [(mesh.centres, mesh.rims, share[mesh.centres])]
    entries += [(own, rims[:, side], curve * LIMIT_SIDE) for side in (0, 1)]
    entries += [_dart_limit(mesh, int(dart)) for dart in torch.nonzero(sharp == 1)[:, 0]]
    return _mask((count, count), *entries)


def _dart_limit(mesh: Connectivity, dart: int) -> tuple[Tensor, Tensor, Tensor]:
    """Return the left eigenvector to 1 of the matrix that takes a dart and its spokes to theirs."""
    spokes = torch.nonzero(mesh.centres == dart)[:, 0]
    around = [dart, *mesh.rims[spokes].tolist()]
    place = {vertex: number for number, vertex in enumerate(around)}
    matrix = np.zeros((len(around), len(around)))
    matrix[0, 1:] = loop_beta(torch.tensor([len(spokes)])).item()
    matrix[0, 0] = 1 - matrix[0].sum()
    for row, edge in enumerate((spokes // 2).tolist(), start=1):
        sharp = mesh.sharpness[edge] >= 1 / 2
        matrix[row, [0, row]] = MIDDLE if sharp else EDGE_END
        for side in () if sharp else mesh.opposites[edge].tolist():
            matrix[row, place[side]] += EDGE_OPPOSITE
    # M has rows of sum 1: l (M − 1) = 0 and Σ l = 1.
    system = np.vstack([matrix.T - np.eye(len(around)), np.ones(len(around))])
    weights = np.linalg.lstsq(system, np.eye(len(around) + 1)[-1], rcond=None)[0]
    return torch.full((len(around),), dart), torch.tensor(around), torch.from_numpy(weights)
