"""What a level's faces are like, measured once for its crease lines and its learned rules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.base.cached import cached_property
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.rings import measure_faces

UNASKED = np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class FaceMeasures:
    """Unit normals of some faces, and area vectors with their lengths.

    They are measured when one is first asked for, and kept until they are forgotten.
    """

    points: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    blocks: Blocks

    @property
    def normals(self) -> Float[np.ndarray, "F 3"]:
        """Unit normals; 0 without area."""
        return self._measured[0]

    @property
    def areas(self) -> Float[np.ndarray, "A 4"]:
        """Twice the area vectors, and their lengths; measured again once they are forgotten."""
        if not self.holds_areas:
            self.forget()
        return self._measured[1]

    @property
    def holds_areas(self) -> bool:
        """Whether the areas have not been forgotten."""
        return len(self._measured[1]) == len(self.faces)

    def forget_areas(self) -> None:
        """Let go of the areas."""
        normals, areas = self._measured
        vars(self)["_measured"] = normals, areas[:0].copy()

    def forget(self) -> None:
        """Let go of all: who asks again has it measured again."""
        vars(self).pop("_measured", None)

    @cached_property
    def _measured(self) -> tuple[Float[np.ndarray, "F 3"], Float[np.ndarray, "A 4"]]:
        areas = np.empty((len(self.faces), 4))
        return _measure(self.points, self.faces, self.blocks, areas), areas


def face_normals(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], blocks: Blocks
) -> Float[np.ndarray, "F 3"]:
    """Return unit normals alone; 0 without area."""
    return _measure(points, faces, blocks, UNASKED)


def _measure(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    blocks: Blocks,
    areas: Float[np.ndarray, "A 4"],
) -> Float[np.ndarray, "F 3"]:
    """Return normals, and write areas where there are rows for them."""
    normals = np.empty((len(faces), 3))
    blocks.run(len(faces), measure_faces.over(points, faces, ROWS, normals, areas))
    return normals
