"""A base scheme: what is left when nothing is learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Integer

from pns_common.kernels import loop as kernels
from pns_common.mesh.topology import Topology, split_faces
from pns_common.parallel import Blocks
from pns_common.schemes.sector_masks import LimitNormals

WIDTH = 3
# Weights of a vertex on a sharp curve and of either neighbour along it, at each level and for ever.
CURVE = kernels.CURVE_CENTRE, kernels.CURVE_NEIGHBOUR
CURVE_LIMIT = 2 / 3, 1 / 6
Place = Callable[[Float[np.ndarray, "V K"], Topology, Blocks], Float[np.ndarray, "W K"]]


@runtime_checkable
class Split(Protocol):
    """Split every face; ``inherit``: whether the halves of sharp edges stay sharp."""

    def __call__(self, parent: Topology, blocks: Blocks, *, inherit: bool = True) -> Topology:
        """Return the topology of the split mesh."""
        ...


@dataclass(frozen=True)
class Limit:
    """A scheme's limit: what its masks become when they are applied for ever.

    Attributes:
        positions: returns the limits of three columns of a mesh's vertices.
        normals: returns the normals of the limit surface there.
    """

    positions: Place = field(repr=False)
    normals: Callable[[Float[np.ndarray, "V 3"], Topology, Blocks], LimitNormals] = field(
        repr=False
    )


@dataclass(frozen=True)
class BaseScheme:
    """A linear subdivision scheme. Its masks have rows ≥ 0 that sum to 1.

    Attributes:
        name: its name in reports and on model cards.
        place: applies the masks of one level to any columns: rows of old vertices, then new ones.
        split: splits the faces.
        faces: returns the faces of the split alone, in the order of ``split``.
        polygons: whether it splits faces of any degree, into a quad for each corner; else it splits
            triangles in four.
        limit: its limit masks; the learned rule's prior is made of them. None for schemes without.
    """

    name: str
    place: Place = field(repr=False)
    split: Split = field(repr=False)
    faces: Callable[..., Integer[np.ndarray, "C N"]] = field(default=split_faces, repr=False)
    polygons: bool = field(default=False, repr=False)
    limit: Limit | None = field(default=None, repr=False)


def follow_curves(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    curve: tuple[float, float],
    placed: Float[np.ndarray, "V 3"],
) -> None:
    """Move vertices on sharp and soft edges, in place, from where the smooth rule put them.

    ``curve``: weights of a vertex and of either neighbour along a curve.
    """
    sharp = topology.sharpest
    if sharp is not None:
        read = sharp.rows, sharp.weights, sharp.neighbours
        kernels.blend_sharp(points, *read, *curve, placed)


def in_threes(
    values: Float[np.ndarray, "V K"],
    rows: int,
    masks: Callable[[Float[np.ndarray, "V 3"]], Float[np.ndarray, "R 3"]],
) -> Float[np.ndarray, "R K"]:
    """Apply masks, which take three columns and return so many rows, to any number of columns."""
    width = values.shape[1]
    if width == WIDTH:
        return masks(np.ascontiguousarray(values, dtype=np.float64))
    placed = np.empty((rows, width))
    for start in range(0, width, WIDTH):
        given = values[:, start : start + WIDTH]
        three = np.zeros((len(values), WIDTH))
        three[:, : given.shape[1]] = given
        placed[:, start : start + WIDTH] = masks(three)[:, : given.shape[1]]
    return placed
