"""Shading of a result: marked sharp edges, smooth faces, normals of the limit surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float

from pns_common.mesh.normals import measure_faces
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes.limit import limit_normals

from .positions import Positions
from .snapshot import Domain, Layer, Rule
from .steps import Steps

NORMALS = Layer("normals", "NORMAL", Domain.CORNER, Rule.BLEND, np.empty((0, 3)), unit=True)
SHARP_EDGE, SHARP_FACE = "sharp_edge", "sharp_face"


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
        if layer.name == SHARP_EDGE and layer.domain is Domain.EDGE:
            sharp |= layer.values[:, 0].astype(bool)
            continue
        made.append(layer)
    if sharp.any():
        flags = sharp[:, None]
        made.append(Layer(SHARP_EDGE, "BOOLEAN", Domain.EDGE, Rule.KEEP, flags))
    flat = any(layer.name == SHARP_FACE for layer in made)
    if normals is not None and not flat and all(x.kind != "NORMAL" for x in made):
        made.append(NORMALS.of(normals(sharp[: len(sharp) - loose])))
    return made


def corner_normals(
    steps: Steps, positions: Positions, sharp: Bool[np.ndarray, " E"]
) -> Float[np.ndarray, "C 3"]:
    """Return the limit surface's normal at each corner of whole levels, one-sided along edges."""
    blocks = Blocks(available_threads())
    topology = steps.at_last.with_creases(np.flatnonzero(sharp))
    found = limit_normals(positions.controls, topology, blocks, steps.base)
    normals = found.sectors[found.sector_of_corner]
    # Where the surface has none its face has one.
    faces, _ = measure_faces(positions.points, topology, blocks, areas=False)
    owner = topology.face_of(np.arange(len(normals)))
    return np.where(normals.any(axis=1)[:, None], normals, faces[owner])
