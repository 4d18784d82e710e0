"""The feature sets that a model card may name, as data: columns, ranges, signs and symmetries.

``kernels.frames`` and ``kernels.measures`` compute the columns, docs/reference/features.md defines
them.

With c to the left of a → b, a stencil (a, b, c, d) can still be read in two ways, and a mirrored or
turned-over mesh is read in its own. Each of these symmetries is a signed permutation g of the
features and a diagonal D_g of the local frame; an η with η(g φ) = D_g η(φ) does not depend on the
reading:

    half-turn   a ↔ b, c ↔ d                            D = diag(−1, 1, −1)
    mirror      c ↔ d, mesh reflected and faces turned  D = diag(1, 1, −1)
    turn-over   c ↔ d, all faces turned                 D = diag(1, −1, −1)

The three commute, so they make groups of 4 (without the last) and 8. Features without a sign cannot
tell a mesh from the same mesh turned over: their group has no turn-over, or η would lose N.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, pi
from types import MappingProxyType

import numpy as np
from jaxtyping import Float, Int64, Integer


@dataclass(frozen=True)
class Feature:
    """One column, and its behaviour under each symmetry: renamed vertices, and a sign.

    Attributes:
        kind: what is measured.
        vertices: the vertices of the stencil that it belongs to, such as "a" or "bc", in any order;
            empty where it belongs to all.
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

    order: Integer[np.ndarray, "G K"]
    signs: Float[np.ndarray, "G K"]
    local: Float[np.ndarray, "G A"]


@dataclass(frozen=True)
class FeatureGroup:
    """Features that belong together: one column each, in this order.

    Attributes:
        rings: whether any reads the rings of the ends or wings: mean normals, umbrella heights.
    """

    name: str
    features: tuple[Feature, ...]
    rings: bool = True


@dataclass(frozen=True)
class FeatureSet:
    """Named groups of features; ``generators`` make the group of their symmetries."""

    name: str
    groups: tuple[FeatureGroup, ...]
    generators: tuple[Generator, ...] = field(repr=False)

    @property
    def features(self) -> tuple[Feature, ...]:
        """The columns in order."""
        return tuple(feature for group in self.groups for feature in group.features)

    @property
    def count(self) -> int:
        """K, the number of columns."""
        return len(self.features)

    @cached_property
    def starts(self) -> Int64[np.ndarray, " G"]:
        """The first column of each of `EDGE_GROUPS`; −1 for those that the set has not."""
        starts, column = [-1] * len(EDGE_GROUPS), 0
        for group in self.groups:
            starts[EDGE_GROUPS.index(group)] = column
            column += len(group.features)
        return np.array(starts, dtype=np.int64)

    @property
    def rings(self) -> bool:
        """True where any group reads rings."""
        return any(group.rings for group in self.groups)

    @cached_property
    def symmetries(self) -> Symmetries:
        """The group that ties the weights of a network over these features."""
        return symmetries(self.features, self.generators)


def symmetries(features: Sequence[Feature], generators: Sequence[Generator]) -> Symmetries:
    """Return all products of commuting generators, each of order two.

    Element i is the product of the generators whose bits i has.
    """
    count = len(features)
    elements = [(np.arange(count), np.ones(count), np.ones(3))]
    for generator in generators:
        order, signs = _signed_permutation(features, generator)
        local = np.array(generator.local, dtype=float)
        elements += [(o[order], signs * s[order], local * d) for o, s, d in elements]
    orders, all_signs, locals_ = zip(*elements, strict=True)
    return Symmetries(np.stack(orders), np.stack(all_signs), np.stack(locals_))


def _signed_permutation(
    features: Sequence[Feature], generator: Generator
) -> tuple[Integer[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    renaming = str.maketrans(generator.vertices, generator.renamed)
    place = {(each.kind, frozenset(each.vertices)): k for k, each in enumerate(features)}
    order = [place[each.kind, frozenset(each.vertices.translate(renaming))] for each in features]
    signs = [getattr(feature, generator.name) for feature in features]
    return np.array(order), np.array(signs, dtype=float)


def _tilts(vertices: str) -> tuple[Feature, ...]:
    """Return m_v · T and m_v · B of two vertices."""
    along = [Feature("m T", vertex, half_turn=-1, turn_over=-1) for vertex in vertices]
    across = [Feature("m B", vertex, half_turn=-1, mirror=-1) for vertex in vertices]
    return (*along, *across)


# x = 1 − n1 · n2, and log ‖c − a‖ / h, …
_CURVATURE = FeatureGroup("curvature", (Feature("x", limit=2.0),), rings=False)
_SHAPE = FeatureGroup(
    "shape",
    tuple(Feature("log", side, limit=inf) for side in ("ac", "bc", "ad", "bd")),
    rings=False,
)
# (n1 × n2) · T, positive on a crest.
_DIHEDRAL = FeatureGroup("dihedral", (Feature("dihedral", turn_over=-1),), rings=False)
_ENDS, _WINGS = FeatureGroup("ends", _tilts("ab")), FeatureGroup("wings", _tilts("cd"))
# u_v · m_v / h_v, negative on a crest.
_UMBRELLA = FeatureGroup(
    "umbrella", tuple(Feature("umbrella", vertex, turn_over=-1) for vertex in "abcd")
)


def _vectors(kind: str, vertices: str) -> tuple[Feature, ...]:
    """Return the coordinates along T, N and B of a vector at each of some vertices."""
    return tuple(
        Feature(f"{kind} {axis}", vertex, mirror=-1 if axis == "B" else 1, limit=limit)
        for vertex in vertices
        for axis in "TNB"
        for limit in (1.0 if kind == "normal" else 3.0,)
    )


# Of a directed edge a → b, c to its left: `kernels.directed` writes them.
_DIRECTED = (
    Feature("turn", limit=pi),
    Feature("tanh turn / 0.3"),
    Feature("tanh turn / 0.1"),
    *_vectors("opposite", "cd"),
    *_vectors("normal", "ab"),
    *_vectors("umbrella", "ab"),
    *(Feature("length over the mean", vertex, limit=3.0) for vertex in "ab"),
    *(Feature("log valence / 6", vertex, limit=inf) for vertex in "ab"),
    *(Feature("at a border", vertex) for vertex in "ab"),
    Feature("is a border"),
)

# In the order of the numbers that `kernels.frames` knows them by.
EDGE_GROUPS = (_CURVATURE, _SHAPE, _DIHEDRAL, _ENDS, _WINGS, _UMBRELLA)

_UNSIGNED, _SIGNED = (HALF_TURN, MIRROR), (HALF_TURN, MIRROR, TURN_OVER)
PAPER_5 = FeatureSet("paper-5", (_CURVATURE, _SHAPE), _UNSIGNED)
SIGNED_18 = FeatureSet(
    "signed-18", (_CURVATURE, _SHAPE, _DIHEDRAL, _ENDS, _WINGS, _UMBRELLA), _SIGNED
)
DIRECTED_28 = FeatureSet("directed-28", (FeatureGroup("directed", _DIRECTED),), (MIRROR,))

# Sets of the paper's rule, by the name on a model card.
FEATURE_SETS: Mapping[str, FeatureSet] = MappingProxyType(
    {features.name: features for features in (PAPER_5, SIGNED_18)}
)
