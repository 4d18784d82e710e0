"""Whose rows and faces joined primitives hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.distinct import distinct_rows


@dataclass(frozen=True, eq=False)
class Parts:
    """Which of P meshes the rows and the faces of joined primitives are of, primitive by primitive.

    Attributes:
        of_row: (N,) the part of each row.
        of_face: (F,) the part of each face.
        count: P.
    """

    of_row: Int[np.ndarray, " N"]
    of_face: Int[np.ndarray, " F"]
    count: int

    @property
    def order(self) -> Int[np.ndarray, " F"]:
        """The faces part by part, each part's in the order of its primitives."""
        return np.argsort(self.of_face, kind="stable")

    def count_faces(self, chosen: Bool[np.ndarray, " F"]) -> Int[np.ndarray, " P"]:
        """Count the chosen faces of each part."""
        return np.bincount(self.of_face[chosen], minlength=self.count)

    def apart(self, labels: Int[np.ndarray, " N"] | None) -> Int[np.ndarray, " N"]:
        """Return labels of rows that no two parts share."""
        if labels is None:
            return self.of_row
        return distinct_rows(np.column_stack([labels, self.of_row]))
