"""The feature sets that a model card may name: the paper's five, and those with signed ones.

``paper-5`` (the paper's section 3.2), one row for each interior edge:

    [x, log ‖c − a‖/h, log ‖c − b‖/h, log ‖d − a‖/h, log ‖d − b‖/h]

x = 1 − n1 · n2 ∈ [0, 2] is the curvature; the others are shape: real, invariant under scale too.
All see the two faces of the edge and nothing else, and none has a sign.

``signed-18`` adds to them the thirteen of signed_features.py, ``signed-14`` those without the
umbrella. docs/features.md defines them all.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from types import MappingProxyType

from jaxtyping import Float

from pns_common.base.arrays import Array, namespace, norm
from pns_common.features.feature_set import FeatureGroup, FeatureSet
from pns_common.features.signed_features import (
    DIHEDRAL,
    ENDS,
    UMBRELLA,
    WINGS,
    normal_fields,
    vertex_fields,
)
from pns_common.features.symmetry import Feature
from pns_common.geometry.frames import EdgeFrames, EdgeStencil

# Lengths of zero are read as this, so that every logarithm is finite.
SHORTEST = 1e-150


def curvature(stencil: EdgeStencil, frames: EdgeFrames) -> list[Float[Array, " N"]]:
    """Return x = 1 − n1 · n2."""
    return [frames.curvature]


def log_ratios(stencil: EdgeStencil, frames: EdgeFrames) -> list[Float[Array, " N"]]:
    """Return the logarithms of the other four sides over h."""
    xp = namespace(stencil.a)

    def log(length: Float[Array, " N"]) -> Float[Array, " N"]:
        return xp.log(xp.where(length > SHORTEST, length, SHORTEST))

    sides = [
        stencil.c - stencil.a,
        stencil.c - stencil.b,
        stencil.d - stencil.a,
        stencil.d - stencil.b,
    ]
    return [log(norm(side)) - log(frames.length) for side in sides]


CURVATURE = FeatureGroup("curvature", (Feature("x", limit=2.0),), curvature)
SHAPE = FeatureGroup(
    "shape", tuple(Feature("log", s, limit=inf) for s in ("ac", "bc", "ad", "bd")), log_ratios
)

paper_features = FeatureSet("paper-5", (CURVATURE, SHAPE))
tilt_features = FeatureSet("signed-14", (CURVATURE, SHAPE, DIHEDRAL, ENDS, WINGS), normal_fields)
signed_features = FeatureSet(
    "signed-18", (CURVATURE, SHAPE, DIHEDRAL, ENDS, WINGS, UMBRELLA), vertex_fields
)

FEATURE_SETS: Mapping[str, FeatureSet] = MappingProxyType(
    {features.name: features for features in (paper_features, tilt_features, signed_features)}
)
FEATURE_COUNT: Mapping[str, int] = MappingProxyType(
    {name: feature_set.count for name, feature_set in FEATURE_SETS.items()}
)
