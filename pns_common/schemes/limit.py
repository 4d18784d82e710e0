"""The limit surface at the vertices of a mesh, by the base scheme's limit masks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.errors import ParameterError
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme, Limit, in_threes
from pns_common.schemes.loop import LOOP
from pns_common.schemes.sector_masks import LimitNormals


def limit_positions(
    points: Float[np.ndarray, "V K"],
    topology: Topology,
    blocks: Blocks | None = None,
    base: BaseScheme = LOOP,
) -> Float[np.ndarray, "V K"]:
    """Return the limit of each vertex, or of any columns that the scheme's masks refine.

    Raises:
        ParameterError: the scheme has no limit masks.
    """
    masks, blocks = _masks(base), blocks or Blocks()

    def by_masks(values: np.ndarray, mesh: Topology) -> np.ndarray:
        return in_threes(values, len(values), lambda three: masks.positions(three, mesh, blocks))

    limits = by_masks(points, topology)
    loops = topology.edges[topology.edges[:, 0] == topology.edges[:, 1], 0]
    if len(loops):
        # Around a face that names a vertex twice an edge may lead from a vertex to itself. The
        # next mesh does not have that edge.
        refined = base.place(points, topology, blocks)
        limits[loops] = by_masks(refined, base.split(topology, blocks))[loops]
    return limits


def limit_shift(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    blocks: Blocks | None = None,
    base: BaseScheme = LOOP,
) -> float:
    """Return how far creases and corners move the limit of a vertex, at most; 0 without any."""
    if not (len(topology.crease_edges) or len(topology.soft) or topology.has_corners):
        return 0.0
    smooth = limit_positions(points, topology.without_creases(), blocks, base)
    moved = limit_positions(points, topology, blocks, base) - smooth
    return float(np.sqrt(np.einsum("ij,ij->i", moved, moved).max(initial=0.0)))


def limit_normals(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    blocks: Blocks | None = None,
    base: BaseScheme = LOOP,
) -> LimitNormals:
    """Return the normals of the limit surface at the limits of the vertices.

    Raises:
        ParameterError: the scheme has no limit masks.
    """
    return _masks(base).normals(points, topology, blocks or Blocks())


def _masks(base: BaseScheme) -> Limit:
    if base.limit is None:
        raise ParameterError("limit", True, expected=f"False: {base.name} has no limit masks")
    return base.limit
