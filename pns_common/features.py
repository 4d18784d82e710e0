"""Rigid-invariant edge features φ. A feature set is a function; its name stands on the model card.

``paper-5`` (the paper's section 3.2), one row for each interior edge:

    [x, log ‖c − a‖/h, log ‖c − b‖/h, log ‖d − a‖/h, log ‖d − b‖/h]

x = 1 − n1 · n2 ∈ [0, 2] is the curvature; the others are shape: real, invariant under scale too.
All see the two faces of the edge and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from jaxtyping import Float

from pns_common.arrays import Array, namespace, norm
from pns_common.frames import EdgeFrames, EdgeStencil

# Lengths of zero are read as this, so that every logarithm is finite.
SHORTEST = 1e-150

FeatureSet = Callable[[EdgeStencil, EdgeFrames], Array]


def paper_features(at: EdgeStencil, frames: EdgeFrames) -> Float[Array, "N 5"]:
    """The paper's five: the curvature x and four log edge-length ratios."""
    xp = namespace(at.a)

    def log(length: Float[Array, " N"]) -> Float[Array, " N"]:
        return xp.log(xp.where(length > SHORTEST, length, SHORTEST))

    sides = [at.c - at.a, at.c - at.b, at.d - at.a, at.d - at.b]
    ratios = [log(norm(side)) - log(frames.length) for side in sides]
    return xp.stack([frames.curvature, *ratios], axis=-1)


FEATURE_SETS: Mapping[str, FeatureSet] = MappingProxyType({"paper-5": paper_features})
FEATURE_COUNT: Mapping[str, int] = MappingProxyType({"paper-5": 5})
