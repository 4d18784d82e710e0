"""Points of many instances, each measured against its own surface, a family at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common.base.arrays import gather
from train.surfaces.implicit import Surface


@dataclass(frozen=True, eq=False)
class SurfaceUnion:
    """The surfaces of P points; it is one itself, but for the feature's distance.

    Attributes:
        families: one surface a family, its parameters arrays with one entry for each of its rows.
        rows: for each family the points that belong to it.
        order: undoes the concatenation of `rows`.
    """

    families: tuple[Surface, ...]
    rows: tuple[Int[np.ndarray, " M"], ...]
    order: Int[np.ndarray, " P"]

    def value(self, points: Float[Tensor, "P 3"]) -> Float[Tensor, " P"]:
        """Return f at each point."""
        parts = zip(self.families, self.rows, strict=True)
        return self._joined([family.value(gather(points, rows)) for family, rows in parts])

    def gradient(self, points: Float[Tensor, "P 3"]) -> Float[Tensor, "P 3"]:
        """Return ∇f at each point."""
        parts = zip(self.families, self.rows, strict=True)
        return self._joined([family.gradient(gather(points, rows)) for family, rows in parts])

    def _joined(self, parts: list[Tensor]) -> Tensor:
        return gather(torch.cat(parts), self.order)


def surface_union(
    surfaces: Sequence[Surface],
    owner: Int[np.ndarray, " P"],
    dtype: torch.dtype = torch.float64,
    device: torch.device | str = "cpu",
) -> SurfaceUnion:
    """Return the surfaces of points that belong to the instances `owner`."""
    families, rows = [], []
    for family in dict.fromkeys(type(surface) for surface in surfaces):
        members = [index for index, surface in enumerate(surfaces) if type(surface) is family]
        own = np.flatnonzero(np.isin(owner, members))
        names = [field.name for field in fields(surfaces[members[0]])]
        table = np.zeros((len(surfaces), len(names)))
        table[members] = [[getattr(surfaces[member], name) for name in names] for member in members]
        columns = torch.from_numpy(table[owner[own]]).to(device=device, dtype=dtype).unbind(dim=1)
        families.append(replace(surfaces[members[0]], **dict(zip(names, columns, strict=True))))
        rows.append(own)
    order = np.argsort(np.concatenate(rows), kind="stable")
    return SurfaceUnion(tuple(families), tuple(rows), order)
