"""Features with a sign: they tell a crest from a trough. Definitions: docs/features.md.

With m_v the mean normal of vertex v's faces, u_v the mean of its neighbours less itself and h_v the
root mean square of its spokes, beside the five of ``paper-5``:

    dihedral   (n1 × n2) · T                 positive on a crest
    ends       m_a · T, m_b · T, m_a · B, m_b · B
    wings      m_c · T, m_d · T, m_c · B, m_d · B
    umbrella   u_v · m_v / h_v               for v = a, b, c, d; negative on a crest

All lie in [−1, 1]; none sees scale. Vertex data is read from ``EdgeStencil.fields``: m_v in the
first three columns, u_v · m_v / h_v in the fourth where the set has the umbrella.
"""

from __future__ import annotations

from jaxtyping import Float

from pns_common.base.arrays import Array, cross, dot, namespace
from pns_common.features.feature_set import FeatureGroup
from pns_common.features.symmetry import Feature
from pns_common.geometry.frames import EdgeFrames, EdgeStencil
from pns_common.geometry.rings import Rings


def normal_fields(rings: Rings) -> Float[Array, "V 3"]:
    """Return m_v alone, for sets without the umbrella."""
    return rings.normal


def vertex_fields(rings: Rings) -> Float[Array, "V 4"]:
    """Return m_v and u_v · m_v / h_v; the latter 0 on boundary, irregular and crease edges."""
    return namespace(rings.normal).concat([rings.normal, rings.height], axis=1)


def signed_dihedral(stencil: EdgeStencil, frames: EdgeFrames) -> list[Float[Array, " N"]]:
    """Return (n1 × n2) · T: the sine of the angle between the faces, positive on a crest."""
    return [dot(cross(stencil.n1, stencil.n2), frames.tangent)]


def end_normals(stencil: EdgeStencil, frames: EdgeFrames) -> list[Float[Array, " N"]]:
    """Return how the surface tilts at the two ends, along the edge and across it."""
    return _tilts(stencil, frames, (0, 1))


def wing_normals(stencil: EdgeStencil, frames: EdgeFrames) -> list[Float[Array, " N"]]:
    """Return how the surface tilts at the two opposite vertices."""
    return _tilts(stencil, frames, (2, 3))


def umbrella_heights(stencil: EdgeStencil, frames: EdgeFrames) -> list[Float[Array, " N"]]:
    """Return how far each vertex stands below its neighbours' mean."""
    fields = _fields(stencil)
    return [fields[:, vertex, 3] for vertex in range(4)]


def _tilts(
    stencil: EdgeStencil, frames: EdgeFrames, vertices: tuple[int, int]
) -> list[Float[Array, " N"]]:
    fields = _fields(stencil)
    axes = (frames.tangent, frames.binormal)
    return [dot(fields[:, vertex, :3], axis) for axis in axes for vertex in vertices]


def _fields(stencil: EdgeStencil) -> Float[Array, "N 4 M"]:
    assert stencil.fields is not None, "edge_stencil was not given the feature set's fields"
    return stencil.fields


def _tilt_features(vertices: str) -> tuple[Feature, ...]:
    along = [Feature("m T", vertex, half_turn=-1, turn_over=-1) for vertex in vertices]
    across = [Feature("m B", vertex, half_turn=-1, mirror=-1) for vertex in vertices]
    return (*along, *across)


DIHEDRAL = FeatureGroup("dihedral", (Feature("dihedral", turn_over=-1),), signed_dihedral)
ENDS = FeatureGroup("ends", _tilt_features("ab"), end_normals)
WINGS = FeatureGroup("wings", _tilt_features("cd"), wing_normals)
UMBRELLA = FeatureGroup(
    "umbrella",
    tuple(Feature("umbrella", vertex, turn_over=-1) for vertex in "abcd"),
    umbrella_heights,
)
