"""Vertices that no refined face uses: they leave the file with the geometry that they lie in."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import marked

from ..read.primitives import TrianglePrimitive
from ..read.schema import Document


@dataclass
class VertexUse:
    """The elements of POSITION accessors that refined faces use; primitives may share accessors."""

    document: Document
    rows: defaultdict[int, list[Int[np.ndarray, " N"]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    refined: set[tuple[int, int]] = field(default_factory=set)

    def add(
        self,
        mesh: int,
        primitives: Sequence[TrianglePrimitive],
        kept: Sequence[Bool[np.ndarray, " F"]],
    ) -> None:
        """Note the primitives of a mesh that were refined, and which of their faces."""
        for primitive, keep in zip(primitives, kept, strict=True):
            if keep.any():
                source = self.document.meshes[mesh].primitives[primitive.number]
                self.refined.add((mesh, primitive.number))
                rows = primitive.rows
                # A primitive's rows are those that its faces name.
                if not keep.all():
                    rows = rows[marked(primitive.corners[keep].reshape(-1), len(rows))]
                self.rows[source.attributes["POSITION"]].append(rows)

    def unused(self) -> int:
        """Count elements that no refined face uses, of accessors that nothing else uses either."""
        others = {
            primitive.attributes["POSITION"]
            for mesh, content in enumerate(self.document.meshes)
            for number, primitive in enumerate(content.primitives)
            if (mesh, number) not in self.refined and "POSITION" in primitive.attributes
        }
        return sum(
            self.document.accessors[accessor].count - _count_distinct(rows)
            for accessor, rows in self.rows.items()
            if accessor not in others
        )


def _count_distinct(rows: Sequence[Int[np.ndarray, " N"]]) -> int:
    """Count what primitives name, each of them in ascending order."""
    # np.unique, which has no use for their order, takes several times as long.
    ordered = rows[0] if len(rows) == 1 else np.sort(np.concatenate(rows))
    return 1 + int(np.count_nonzero(ordered[1:] != ordered[:-1]))
