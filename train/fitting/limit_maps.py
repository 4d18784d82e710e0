"""Loop's remaining levels and its limit masks as sparse matrices.

After the learned levels everything is linear in the points: the limit surface at the vertices of a
finer level, and its two tangents there. So training evaluates it exactly, without a rollout.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from train.connectivity import Connectivity, connect
from train.loop_masks import limit_mask, loop_mask, tangent_masks


@dataclass(frozen=True, eq=False)
class LimitMaps:
    """From the points of one level to Loop's limit surface at the vertices of a finer one.

    Attributes:
        position, tangent, cotangent: (M, N) matrices; position × tangent makes the outward normal
            with the cotangent, at smooth vertices alone.
        smooth: whether each of the M vertices has a closed ring; else its tangents are 0.
        faces: of the finer level.
        ancestor: a vertex of the coarser level that belongs to the same mesh.
    """

    position: sparse.csr_array
    tangent: sparse.csr_array
    cotangent: sparse.csr_array
    smooth: Bool[np.ndarray, " M"]
    faces: Int[np.ndarray, "F 3"]
    ancestor: Int[np.ndarray, " M"]


def limit_maps(mesh: Connectivity, levels: int) -> LimitMaps:
    """Return the maps from a level's points to the limit at the vertices of `levels` further on."""
    ancestor = np.arange(mesh.vertex_count)
    refined = sparse.eye_array(mesh.vertex_count, format="csr")
    for _ in range(levels):
        refined = loop_mask(mesh).matrix() @ refined
        ancestor = np.concatenate([ancestor, ancestor[mesh.edges[:, 0].numpy()]])
        mesh = connect(mesh.split().numpy(), mesh.vertex_count + len(mesh.edges))
    tangent, cotangent = tangent_masks(mesh)
    return LimitMaps(
        position=sparse.csr_array(limit_mask(mesh).matrix() @ refined),
        tangent=sparse.csr_array(tangent.matrix() @ refined),
        cotangent=sparse.csr_array(cotangent.matrix() @ refined),
        smooth=mesh.ringed.numpy(),
        faces=mesh.faces.numpy(),
        ancestor=ancestor,
    )


def applied(matrix: sparse.csr_array, points: Float[Tensor, "N K"]) -> Float[Tensor, "M K"]:
    """Return matrix · points, with a gradient."""
    return _Applied.apply(points, matrix)


class _Applied(torch.autograd.Function):
    """SciPy's product: on one thread a few times as fast as torch's."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, matrix: sparse.csr_array) -> Tensor:
        ctx.matrix = matrix
        return torch.from_numpy(matrix @ points.detach().numpy())

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        back = ctx.matrix.T @ np.ascontiguousarray(gradient.numpy())
        return torch.from_numpy(back), None
