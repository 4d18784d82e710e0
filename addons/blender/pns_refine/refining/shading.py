"""Shading of a result: marked sharp edges, smooth faces, normals of the limit surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float

from pns_common.carry import rules

from .snapshot import Domain, Layer

SHARP_EDGE, SHARP_FACE = "sharp_edge", "sharp_face"


def normals_layer(values: Float[np.ndarray, "C 3"]) -> Layer:
    """Return normals of corners as an attribute."""
    return Layer(values, rules.smooth, unit=True, name="normals", kind="NORMAL", domain="CORNER")


def switch(name: str, domain: Domain, on: Bool[np.ndarray, " N"]) -> Layer:
    """Return switches of old elements as an attribute."""
    return Layer(on[:, None], rules.old, name=name, kind="BOOLEAN", domain=domain)


def shaded(
    layers: Sequence[Layer],
    sharp: Bool[np.ndarray, " E"],
    loose: int,
    normals: Callable[[Bool[np.ndarray, " E"]], Float[np.ndarray, "C 3"]] | None,
    *,
    smooth: bool,
) -> list[Layer]:
    """Return the layers of a result with its shading; ``loose`` edges have no faces.

    Edges that are sharp on the surface are marked beside those of the mesh. ``smooth`` takes the
    marks of flat faces away, which are edges by then; where all faces are flat they go in any
    case. A mesh without normals of its own gets those of the limit surface, if it lies on that:
    ``normals`` gives those of corners, one-sided along the edges that are sharp.
    """
    sharp = np.r_[sharp, np.zeros(loose, dtype=bool)]
    made: list[Layer] = []
    for layer in layers:
        if layer.name == SHARP_FACE and (smooth or layer.values.all()):
            continue
        if layer.name == SHARP_EDGE and layer.domain == "EDGE":
            sharp |= layer.values[:, 0].astype(bool)
            continue
        made.append(layer)
    if sharp.any():
        made.append(switch(SHARP_EDGE, "EDGE", sharp))
    flat = any(layer.name == SHARP_FACE for layer in made)
    if normals is not None and not flat and all(x.kind != "NORMAL" for x in made):
        made.append(normals_layer(normals(sharp[: len(sharp) - loose])))
    return made
