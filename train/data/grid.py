"""The paper's coarse patch: a 9 × 9 grid on [−1, 1]², its interior jittered."""

import numpy as np
import torch
from jaxtyping import Float, Int

# Vertices along one side of the patch.
SIDE = 9


def grid_faces() -> Int[np.ndarray, "F 3"]:
    """Return the 128 faces; vertex i·9 + j stands at (x_i, y_j).

    The quad (i, j) gives (v00, v10, v11) and (v00, v11, v01), so all diagonals run one way and
    normals point to +z.
    """
    i, j = (axis.ravel() for axis in np.mgrid[: SIDE - 1, : SIDE - 1])
    v00 = i * SIDE + j
    v10, v11, v01 = v00 + SIDE, v00 + SIDE + 1, v00 + 1
    halves = np.stack([np.stack([v00, v10, v11], -1), np.stack([v00, v11, v01], -1)], axis=1)
    return halves.reshape(-1, 3).astype(np.int64)


def jittered_grid(seed: int, jitter: float) -> Float[torch.Tensor, "81 2"]:
    """Return the patch's (x, y) in float32, interior vertices moved by (u − ½) · jitter · 2/9.

    u is `torch.rand(81, 2)`: the published draws come from torch's float32 generator, so nothing
    else reproduces them.
    """
    axis = torch.linspace(-1, 1, SIDE)
    points = torch.cartesian_prod(axis, axis)
    draws = torch.rand(SIDE * SIDE, 2, generator=torch.Generator().manual_seed(seed))
    offsets = (draws - 0.5) * jitter * (2 / SIDE)
    interior = (points.abs() < 1).all(dim=-1, keepdim=True)
    return torch.where(interior, points + offsets, points)
