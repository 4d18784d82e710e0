"""Loop's limit surface at the vertices of a mesh: exact positions and normals, by masks."""

from pns_common.masks.limit.normals import LimitNormals, limit_normals
from pns_common.masks.limit.positions import limit_positions
from pns_common.masks.limit.refined import refined_limit_normals, refined_limit_positions

__all__ = [
    "LimitNormals",
    "limit_normals",
    "limit_positions",
    "refined_limit_normals",
    "refined_limit_positions",
]
