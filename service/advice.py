"""Say why a refinement changed little, and which option changes that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.creases import Creases
from pns_common.fused.where_loaded.interior_edges import interior_edges
from pns_common.geometry.frames import face_normals
from pns_common.geometry.sharp_edges import turn_by_more
from pns_common.levels.diagnostics import LevelReport
from pns_common.mesh import Mesh

# Plane faces in single precision turn by less.
BENT = math.radians(0.5)
# From this share of sharp edges, or of borders, on, little is rounded.
MOST = 0.9


@dataclass(frozen=True)
class Bends:
    """How many edges of a control mesh bend, and how many of these are kept sharp."""

    bent: int = 0
    sharp: int = 0


NO_BENDS = Bends()


def count_bends(
    mesh: Mesh,
    creases: Creases,
    crease_edges: Sequence[int],
    part_of_face: Int[np.ndarray, " F"] | None = None,
) -> list[Bends]:
    """Count the bent edges of each part of a mesh, and the sharp ones among them.

    `crease_edges` are the counts in the parts' reports at the first level. They stand for the lines
    that the operator found: these have no names here, and all bend. Nothing is counted where no
    sharp edges are asked for. Without `part_of_face` the mesh is one part.
    """
    count = len(crease_edges)
    if creases.named is None and creases.line_angle is None:
        return [NO_BENDS] * count
    edges, half_edges = interior_edges(mesh.faces, len(mesh.vertices))
    faces = half_edges // 3
    bent = turn_by_more(face_normals(mesh.vertices, mesh.faces), faces, BENT)
    part = np.zeros(len(edges), dtype=np.int64)
    if part_of_face is not None:
        part = part_of_face[faces[:, 0]]
    sharp = list(crease_edges)
    if creases.named is not None and len(creases.named):
        named = bent & np.isin(_codes(edges), _codes(creases.named))
        sharp = np.bincount(part[named], minlength=count).tolist()
    return list(map(Bends, np.bincount(part[bent], minlength=count).tolist(), sharp))


def advice_on(levels: Sequence[LevelReport], bends: Bends) -> list[str]:
    """Return the reasons why a shape changed little, each with the option to set."""
    if not levels:
        return []
    edges = levels[0]["edges"]
    total = sum(edges[kind] for kind in ("interior", "boundary", "irregular")) + edges.get(
        "crease", 0
    )
    if bends.bent and bends.sharp >= MOST * bends.bent:
        return [
            f"{bends.sharp} of {bends.bent} bent edges are kept sharp: "
            "use crease=off for a rounder shape"
        ]
    if edges["boundary"] >= MOST * total:
        return [
            f"{edges['boundary']} of {total} edges are open borders, and faces that only touch "
            "stay apart: use weld_tolerance=0.001 to join vertices that nearly coincide"
        ]
    if levels[-1]["normal_jump_max"] < BENT and not edges.get("crease"):
        return ["the shape is flat: refining adds faces and rounds outlines, nothing else"]
    return []


def _codes(pairs: Int[np.ndarray, "N 2"]) -> Int[np.ndarray, " N"]:
    low, high = np.sort(pairs.astype(np.int64), axis=1).T
    return low << 32 | high
