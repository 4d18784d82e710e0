"""Refine values at corners, such as UV maps: smooth within a patch, and whole along its seams."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.mesh.rows import first_places
from pns_common.mesh.topology import Topology, build_topology, halves_of
from pns_common.parallel import Blocks
from pns_common.schemes import BaseScheme

from .snapshot import Smoothing, edge_keys
from .steps import one_level, straight_level, with_creases


def refine_corners(
    values: Float[np.ndarray, "C K"],
    faces: tuple[Int[np.ndarray, " C"], Int[np.ndarray, " F1"]],
    base: BaseScheme,
    levels: int,
    creases: Int[np.ndarray, "N 2"],
    vertex_sharpness: Float[np.ndarray, " V"],
    same: Float[np.ndarray, "C J"] | None = None,
    smoothing: Smoothing = Smoothing.PRESERVE_BOUNDARIES,
) -> Float[np.ndarray, "D K"]:
    """Refine values at the corners of faces to those of the faces' children.

    ``faces`` are the corners' vertices, and where the corners of each face begin.

    Corners of a vertex that agree are one point of a patch, and a seam runs where they differ.
    Inside a patch the scheme's masks are used, as for the vertices. ``smoothing`` says which values
    stay: those on the border, whose edges then get their midpoints, so that both sides of a seam
    keep meeting; those of a corner of one face alone; none; or all, which is linear. ``same`` are
    the values that say whether corners agree, if not ``values``.
    """
    vertices, offsets = faces
    patch = patch_points(vertices, values if same is None else same)
    first = first_places(patch, int(patch.max(initial=-1)) + 1)
    columns, vertex_of = values[first], vertices[first]
    plain = build_topology((patch, offsets), len(columns))
    plain = plain.with_vertex_sharpness(vertex_sharpness[vertex_of])
    sharp: Int[np.ndarray, "N 2"] | None = None
    for level in range(levels):
        topology = plain
        if level == 0 and len(creases):
            named = np.isin(edge_keys(vertex_of[topology.edges]), edge_keys(creases))
            sharp = topology.edges[named].astype(np.int64)
        # Where the border begins is seen before creases are: they are no border.
        border = _border(topology)
        if sharp is not None:
            topology = with_creases(topology, sharp)
            sharp = halves_of(topology, topology.crease_edges)
        if smoothing is Smoothing.NONE:
            columns = straight_level(columns, topology, base)
        else:
            finer = one_level(columns, topology, base)
            if smoothing is Smoothing.PRESERVE_CORNERS:
                border &= np.bincount(plain.corners, minlength=len(columns)) == 1
            if smoothing is not Smoothing.SMOOTH_ALL:
                finer[: len(columns)][border] = columns[border]
            columns = finer
        plain = base.split(plain, Blocks())
    return columns[plain.corners]


def patch_points(
    vertices: Int[np.ndarray, " C"], values: Float[np.ndarray, "C K"]
) -> Int[np.ndarray, " C"]:
    """Give each corner a number; those of one vertex that have the same values share it."""
    first = first_places(vertices, int(vertices.max(initial=-1)) + 1)
    # Corners that agree with their vertex's first are found without sorting: on most meshes, all.
    odd = (values != values[first[vertices]]).any(axis=1)
    number = vertices.astype(np.int64)
    if odd.any():
        code = number[odd]
        for column in values[odd].T:
            _, rank = np.unique(column, return_inverse=True)
            _, code = np.unique(code * (int(rank.max()) + 1) + rank, return_inverse=True)
        number = number.copy()
        number[odd] = len(first) + code
    _, number = np.unique(number, return_inverse=True)
    return number.reshape(-1)


def _border(topology: Topology) -> np.ndarray:
    if len(topology.sharp_count) == 0:
        return np.zeros(topology.vertex_count, dtype=bool)
    return topology.sharp_count > 0
