"""A base scheme: what is left when nothing is learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Integer

from pns_common.parallel import Blocks
from pns_common.topology import Topology, split_faces

Place = Callable[[Float[np.ndarray, "V K"], Topology, Blocks], Float[np.ndarray, "W K"]]


@runtime_checkable
class Split(Protocol):
    """Split every face; ``inherit``: whether the halves of sharp edges stay sharp."""

    def __call__(self, parent: Topology, blocks: Blocks, *, inherit: bool = True) -> Topology:
        """Return the topology of the split mesh."""
        ...


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
        limit_weight: of a smooth vertex of valence k, the weight of its neighbours' mean in the
            limit mask; the learned rule's prior is made of it. None for schemes without one.
    """

    name: str
    place: Place = field(repr=False)
    split: Split = field(repr=False)
    faces: Callable[..., Integer[np.ndarray, "C N"]] = field(default=split_faces, repr=False)
    polygons: bool = field(default=False, repr=False)
    limit_weight: Callable[[Integer[np.ndarray, " N"]], Float[np.ndarray, " N"]] | None = field(
        default=None, repr=False
    )
