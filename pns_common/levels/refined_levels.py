"""What going through the levels makes, whoever computes it: array kernels or compiled ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.deferred import Deferred
from pns_common.connectivity.topology import Topology
from pns_common.errors import MeshError
from pns_common.levels.diagnostics import LevelReport
from pns_common.mesh import LARGEST_COORDINATE

# Called at the end of each level.
AfterLevel = Callable[[], None]


@dataclass(frozen=True)
class LevelsReport:
    """The report of each level, and how many vertices of the control mesh have several fans."""

    levels: list[LevelReport]
    multi_fan_vertices: int


@dataclass(frozen=True, eq=False)
class RefinedLevels:
    """The last level's mesh with its diagnostics, and the reports of all.

    Attributes:
        looked_at: what the levels' report says, made where it is asked for: Loop needs none of it.
        split_topology: of the mesh that the last level split, built where it is asked for.
    """

    points: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    ratio: Float[np.ndarray, " V"]
    gate: Float[np.ndarray, " V"]
    looked_at: Deferred[LevelsReport]
    split_topology: Callable[[], Topology]

    @property
    def reports(self) -> list[LevelReport]:
        """The report of each level."""
        return self.looked_at().levels

    @property
    def multi_fan_vertices(self) -> int:
        """Vertices of the control mesh whose faces form more than one fan."""
        return self.looked_at().multi_fan_vertices


def check_coordinates(largest: float) -> None:
    """Refuse refined coordinates that are too large to go on with.

    Raises:
        MeshError: the largest absolute value is above 1e75, or NaN.
    """
    if not largest <= LARGEST_COORDINATE:  # also where it is NaN, as a rule may give it
        found = "not numbers" if math.isnan(largest) else "too large"
        raise MeshError(f"refined coordinates are {found}", element="vertices")
