"""Creases, corners and borders that an OBJ states in OpenSubdiv's tags.

`t crease 2/1/0 0 1 4.7`: how many whole numbers, numbers and words follow, then these. Vertices
count from 0. Sharpness counts levels, and 10 is for good.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Int

from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Mesh

from .text import is_number

FOR_GOOD = 10.0
# By the numbers of OpenSubdiv's and RenderMan's rules; 0 takes the faces at borders away.
_BORDERS = {1: "corners", 2: "smooth"}
_COUNTS = re.compile(rb"(\d{1,9})/(\d{1,9})/(\d{1,9})")


@dataclass
class Tags:
    """Sharpness and borders that tags state for the vertices of a file.

    Attributes:
        edges: sharpness by pairs of vertices.
        vertices: sharpness by vertex.
        border: a rule of `creases.BORDERS`; None: none was stated.
    """

    edges: dict[tuple[int, int], float] = field(default_factory=dict)
    vertices: dict[int, float] = field(default_factory=dict)
    border: str | None = None

    def read(self, words: Sequence[bytes], lost: Counter[str]) -> None:
        """Add a tag, given by the words behind its `t`; what is not understood is counted."""
        name, counts = words[0] if words else b"", _COUNTS.fullmatch(words[1] if words[1:] else b"")
        if counts is None:
            lost["tags that cannot be read"] += 1
            return
        wholes, reals, _ = (int(count) for count in counts.groups())
        given, weights = words[2 : 2 + wholes], words[2 + wholes : 2 + wholes + reals]
        if not (
            (len(given), len(weights)) == (wholes, reals)
            and all(word.isdigit() and len(word) < 10 for word in given)
            and all(is_number(word) for word in weights)
        ):
            lost["tags that cannot be read"] += 1
            return
        vertices = [int(word) for word in given]
        chain = list(pairwise(vertices)) if name == b"crease" else vertices
        sharpness = [_levels(float(word)) for word in weights] * (1 if reals > 1 else len(chain))
        if name == b"interpolateboundary" and vertices and vertices[0] in _BORDERS:
            self.border = _BORDERS[vertices[0]]
        elif name not in (b"crease", b"corner"):
            lost[f"tags {name.decode('latin-1')}"] += 1
        elif not chain or len(sharpness) != len(chain):
            lost["tags that cannot be read"] += 1
        elif name == b"crease":
            self.edges |= dict(zip(pairwise(vertices), sharpness, strict=True))
        else:
            self.vertices |= dict(zip(vertices, sharpness, strict=True))

    def creases(self, mesh: Mesh, vertex_of: Int[np.ndarray, " N"], found: Creases) -> Creases:
        """Return what is stated for a mesh, whose vertex `vertex_of` gives for each of the file's.

        It is −1 where there is none. Pairs that are no edges are left out. Beside edges that a
        model found, what is stated lasts as long as these. The border of `found` holds unless it is
        "smooth", and another is stated.
        """
        given = np.array([*self.edges], dtype=np.int64).reshape(-1, 2)
        pairs, sharpness = _found(given, vertex_of), np.array([*self.edges.values()])
        sides, keys = mesh.topology().edges.astype(np.int64), [len(mesh.vertices), 1]
        known = np.isin(np.sort(pairs, axis=1) @ keys, sides @ keys) & (pairs >= 0).all(axis=1)
        vertices = _found(np.array([*self.vertices], dtype=np.int64), vertex_of)
        there, at_vertices = vertices >= 0, np.array([*self.vertices.values()])
        stated = Creases(
            pairs[known],
            sharpness[known],
            vertices=vertices[there],
            vertex_sharpness=at_vertices[there],
            border=(self.border or "smooth") if found.border == "smooth" else found.border,
            wears=True,
        )
        if found.named is None:
            return stated
        own = np.ones(len(found.named)) if found.sharpness is None else found.sharpness
        return replace(
            stated,
            named=np.concatenate([pairs[known], found.named]),
            sharpness=np.concatenate([np.minimum(sharpness[known], 1.0), own]),
            levels=found.levels,
            soft_corners=found.soft_corners,
            wears=False,
        )


def _levels(sharpness: float) -> float:
    if not sharpness > 0:
        return 0.0
    return np.inf if sharpness >= FOR_GOOD else sharpness


def _found(vertices: np.ndarray, vertex_of: Int[np.ndarray, " V"]) -> np.ndarray:
    """Return the mesh's vertices, -1 where there is none."""
    there = vertices < len(vertex_of)
    return np.where(there, vertex_of[np.where(there, vertices, 0)], -1)
