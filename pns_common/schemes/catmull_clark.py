"""Catmull–Clark subdivision of polygons (Catmull and Clark 1978): masks, split and limit."""

from __future__ import annotations

from pns_common.mesh.topology import quad_faces, split_quads
from pns_common.schemes.base_scheme import BaseScheme, Limit
from pns_common.schemes.catmull_clark_limit import limit_normals, limit_positions
from pns_common.schemes.catmull_clark_masks import place

LIMIT = Limit(limit_positions, limit_normals)
CATMULL_CLARK = BaseScheme(
    "catmull-clark", place, split_quads, quad_faces, polygons=True, limit=LIMIT
)
