"""Pieces cut from a mesh in memory, by brute force."""

from dataclasses import dataclass

import numpy as np

from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.pieces import Piece, RefinedPiece, ThinHaloError, halo_rings, refine_piece


@dataclass(frozen=True, eq=False)
class Cut:
    piece: Piece
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Made:
    """Of a refined piece the children that are its own: its rows, and the whole mesh's."""

    refined: RefinedPiece
    own_children: np.ndarray
    children: np.ndarray


def adjacent(faces, chosen, rings):
    """The chosen faces with so many rings around them."""
    for _ in range(rings):
        chosen = np.isin(faces, faces[chosen]).any(axis=1)
    return chosen


def piece_of(mesh, own, rings, creases=None, lines=NO_CREASES):
    chosen = adjacent(mesh.faces, own, rings)
    faces = np.flatnonzero(chosen)
    vertices, local = np.unique(mesh.faces[chosen], return_inverse=True)
    local = local.reshape(-1, 3)
    whole = ~np.isin(vertices, mesh.faces[~chosen])
    if creases is not None:
        edges = np.sort(local[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).tolist()
        number = {int(v): n for n, v in enumerate(vertices)}
        pairs = [[number.get(int(v), -1) for v in sorted(pair)] for pair in creases]
        here = set(map(tuple, edges))
        creases = np.array([p for p in pairs if tuple(p) in here], dtype=int).reshape(-1, 2)
    kept = lines if creases is None else Creases(creases)
    return Cut(Piece(mesh.vertices[vertices], local, own[chosen], whole, kept), faces)


def pieces_refined(mesh, owner, scheme, levels, length, creases=None, lines=NO_CREASES):
    """All pieces of a mesh refined, each with as many rings as it turns out to need."""
    return [
        _refined(mesh, owner == part, scheme, levels, length, creases, lines)
        for part in np.unique(owner)
    ]


def _refined(mesh, own, scheme, levels, length, creases, lines):
    guard_rings = 1
    while True:
        rings = halo_rings(scheme, levels, guard_rings, lines=lines)
        cut = piece_of(mesh, own, rings, creases, lines)
        try:
            refined = refine_piece(cut.piece, scheme, levels, length, Blocks(1))
            break
        except ThinHaloError:
            assert not cut.piece.whole.all()
            assert scheme.guard is not None
            guard_rings *= 2
    many = 4**levels
    children = (many * cut.faces[:, None] + np.arange(many))[cut.piece.own].reshape(-1)
    return Made(refined, np.repeat(cut.piece.own, many), children)
