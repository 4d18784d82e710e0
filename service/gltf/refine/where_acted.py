"""Where a model acted, at each refined vertex: what `diagnostics=full` adds to a file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from jaxtyping import Float

from pns_common.masks.linear import level_topologies
from pns_common.mesh import Mesh
from pns_common.schemes import Scheme

from ...options import Options

RATIO, GATE = "_PNS_RATIO", "_PNS_GATE"


class Acted(Protocol):
    """A mesh after its last learned level, and what that did at each of its vertices."""

    @property
    def mesh(self) -> Mesh:
        """What it made."""
        ...

    @property
    def ratio(self) -> Float[np.ndarray, " V"]:
        """Proximity ratio."""
        ...

    @property
    def gate(self) -> Float[np.ndarray, " V"]:
        """γ."""
        ...


def vertex_scalars(
    made: Acted, again: Callable[[int], Acted | None], scheme: Scheme, options: Options
) -> dict[str, Float[np.ndarray, " W"]]:
    """Return the attributes of what was made; none where the options ask for none.

    Levels by Loop have nothing of their own to show: after them stand the values of the last
    learned level, and a vertex that they put on an edge has the mean of its ends. `again` refines
    the same to fewer levels, None where it cannot: then what was made shows its own.
    """
    if options.diagnostics != "full":
        return {}
    learned = scheme.learned_levels or options.levels
    acted = again(learned) if learned < options.levels else None
    if acted is None:
        return {RATIO: made.ratio, GATE: made.gate}
    values = np.stack([acted.ratio, acted.gate], axis=1)
    for topology in level_topologies(acted.mesh.faces, len(values), options.levels - learned):
        values = np.concatenate([values, values[topology.edges].mean(axis=1)])
    return {RATIO: values[:, 0], GATE: values[:, 1]}
