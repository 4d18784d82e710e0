"""Symmetries of a stencil: how features and local vectors change when its ambiguity is resolved
otherwise.

With c in the face to the left of a → b, a stencil can still be read in two ways, and a mirrored or
turned-over mesh is read in its own. Each of these is a signed permutation g of the features and a
diagonal D_g of the local frame; an η with η(g φ) = D_g η(φ) does not depend on the reading.

    half-turn   a ↔ b, c ↔ d                            D = diag(−1, 1, −1)
    mirror      c ↔ d, mesh reflected and faces turned  D = diag(1, 1, −1)
    turn-over   c ↔ d, all faces turned                 D = diag(1, −1, −1)

The three commute, so they make groups of 4 (without the last) and 8. Features without a sign cannot
tell a mesh from the same mesh turned over: their group has no turn-over, or η would lose N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class Feature:
    """One feature's behaviour: renamed vertices, and a sign for each symmetry.

    Attributes:
        kind: what is measured.
        vertices: the vertices of the stencil that it belongs to, such as "a" or "bc", in any order;
            none where it belongs to all.
        half_turn, mirror, turn_over: 1 or −1, beside the renaming.
        limit: the largest absolute value.
    """

    kind: str
    vertices: str = ""
    half_turn: int = 1
    mirror: int = 1
    turn_over: int = 1
    limit: float = 1.0


@dataclass(frozen=True)
class Generator:
    """A symmetry as a rule: ``renamed`` in place of ``vertices``, and the diagonal of D."""

    name: str
    vertices: str
    renamed: str
    local: tuple[int, int, int]


HALF_TURN = Generator("half_turn", "abcd", "badc", (-1, 1, -1))
MIRROR = Generator("mirror", "cd", "dc", (1, 1, -1))
TURN_OVER = Generator("turn_over", "cd", "dc", (1, -1, -1))


@dataclass(frozen=True, eq=False)
class Symmetries:
    """A group of G symmetries over K features, the identity first.

    (g φ)_k = signs[g, k] · φ[order[g, k]], and D_g = diag(local[g]).
    """

    order: Int[np.ndarray, "G K"]
    signs: Float[np.ndarray, "G K"]
    local: Float[np.ndarray, "G 3"]


def symmetries(features: Sequence[Feature], generators: Sequence[Generator]) -> Symmetries:
    """Return all products of commuting generators, each of order two."""
    count = len(features)
    elements = [(np.arange(count), np.ones(count), np.ones(3))]
    for generator in generators:
        order, signs = _signed_permutation(features, generator)
        local = np.array(generator.local, dtype=float)
        elements += [(o[order], signs * s[order], local * d) for o, s, d in elements]
    orders, all_signs, locals_ = zip(*elements, strict=True)
    return Symmetries(np.stack(orders), np.stack(all_signs), np.stack(locals_))


def edge_symmetries(features: Sequence[Feature]) -> Symmetries:
    """Return the group of an edge stencil: 8 elements for signed features, else 4."""
    signed = any(feature.turn_over < 0 for feature in features)
    return symmetries(features, [HALF_TURN, MIRROR, *([TURN_OVER] if signed else [])])


def _signed_permutation(
    features: Sequence[Feature], generator: Generator
) -> tuple[Int[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    renaming = str.maketrans(generator.vertices, generator.renamed)
    place = {(each.kind, frozenset(each.vertices)): k for k, each in enumerate(features)}
    order = [place[each.kind, frozenset(each.vertices.translate(renaming))] for each in features]
    signs = [getattr(feature, generator.name) for feature in features]
    return np.array(order), np.array(signs, dtype=float)
