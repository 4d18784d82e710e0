"""What a learned level reads of every vertex's ring, with the bits of geometry/rings.py."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import marked
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import EdgeClass
from pns_common.formula.side_gate import GENTLE_TO_SHARP, widest, with_neighbours
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.extent import mark_referenced
from pns_common.fused.kernels.rings import (
    VERTEX_COLUMNS,
    face_bends,
    mean_neighbours,
    mean_normals,
    mean_spokes,
    prior_pushes,
    umbrella_heights,
)
from pns_common.fused.learned.edge_measures import EdgeMeasures
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.fused.levels.loop_points import owners
from pns_common.fused.levels.mesh_edges import MeshEdges
from pns_common.masks.stencils import limit_ring_weight


@dataclass(frozen=True, eq=False)
class RingMeasures:
    """The rings of all vertices; columns are named in kernels/rings.py.

    Attributes:
        fields: mean normal and umbrella height.
        means: over the spokes of each vertex; none once forgotten.
        smooth: vertices with one closed ring of interior edges.
        ringed: the same with darts, where one crease ends.
    """

    fields: Float[np.ndarray, "V 4"]
    means: Float[np.ndarray, "N M"]
    valence: Int[np.ndarray, " V"]
    smooth: Bool[np.ndarray, " V"]
    ringed: Bool[np.ndarray, " V"]


def measure_bends(
    jumps: Float[np.ndarray, " E"], mesh: MeshEdges, blocks: Blocks
) -> Float[np.ndarray, " F"]:
    """Return b of all faces, as ``side_gate.face_bends`` has it."""
    bends, (gentle, sharp) = np.empty(len(mesh.faces)), GENTLE_TO_SHARP
    blocks.run(len(bends), face_bends.over(mesh.face_edges, jumps, gentle, sharp, ROWS, bends))
    boundary = mesh.sharp_edges[mesh.edge_class[mesh.sharp_edges] == EdgeClass.BOUNDARY]
    # By marks: for its ``unique`` numpy loads a module, 8 ms of a first call.
    rows = np.flatnonzero(marked(mesh.half_edges[boundary, 0] // 3, len(bends)))
    faces = with_neighbours(rows, mesh.face_edges, mesh.half_edges, mesh.edge_class)
    bends[rows] = widest(bends, faces)
    return bends


def measure_rings(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    at_faces: FaceMeasures,
    at_edges: EdgeMeasures,
    multi_fan_vertices: Bool[np.ndarray, " V"],
    blocks: Blocks,
) -> RingMeasures:
    """Look around every vertex of a level."""
    count, by_owner = mesh.vertex_count, owners(blocks, mesh.vertex_count)
    fields, means = np.empty((count, 4)), np.empty((count, VERTEX_COLUMNS))
    valence = np.empty(count, dtype=np.int32)
    spokes = at_edges.bends, at_edges.jumps, at_edges.network_lengths
    along, to = (points, mesh.edges, mesh.edge_reach), (means, valence)
    look_at_faces = mean_normals.over(mesh.faces, mesh.face_reach, at_faces.areas, ROWS, fields)
    look_at_spokes = mean_spokes.over(*along, *spokes, ROWS, *to)
    tell_heights = umbrella_heights.over(means, mesh.sharp, ROWS, fields)

    def around(rows: slice) -> None:
        look_at_faces(rows)
        look_at_spokes(rows)
        tell_heights(rows)

    by_owner.run(count, around)
    by_owner.run(count, mean_neighbours.over(*along, fields, valence, ROWS, means))
    smooth = _smooth(valence > 0, mesh, multi_fan_vertices)
    return RingMeasures(
        fields, means, valence, smooth, _with_darts(smooth, mesh, multi_fan_vertices)
    )


def ringed_vertices(
    mesh: MeshEdges, multi_fan_vertices: Bool[np.ndarray, " V"], blocks: Blocks
) -> Bool[np.ndarray, " V"]:
    """Return the vertices with one closed ring, and darts, without a look at the rings."""
    used = np.zeros(mesh.vertex_count, dtype=bool)
    blocks.run(len(mesh.faces), mark_referenced.over(mesh.faces, ROWS, used))
    return _with_darts(_smooth(used, mesh, multi_fan_vertices), mesh, multi_fan_vertices)


def _smooth(
    used: Bool[np.ndarray, " V"], mesh: MeshEdges, multi_fan_vertices: Bool[np.ndarray, " V"]
) -> Bool[np.ndarray, " V"]:
    """Return the same of those that have an edge."""
    smooth = used & ~multi_fan_vertices
    if len(mesh.sharp):
        smooth &= mesh.sharp == 0
    return smooth


def _with_darts(
    smooth: Bool[np.ndarray, " V"], mesh: MeshEdges, multi_fan_vertices: Bool[np.ndarray, " V"]
) -> Bool[np.ndarray, " V"]:
    """Return the same with the vertices where one crease ends (``topology.ringed_vertices``)."""
    if len(mesh.sharp) == 0:
        return smooth
    sharp = mesh.sharp_edges
    creases = mesh.edges[sharp[mesh.edge_class[sharp] == EdgeClass.CREASE]]
    at_creases = marked(creases.reshape(-1), mesh.vertex_count)
    return smooth | (at_creases & (mesh.sharp == 1) & ~multi_fan_vertices)


def measure_pushes(rings: RingMeasures, blocks: Blocks) -> Float[np.ndarray, "V 3"]:
    """Return d_v of the prior at s = 1."""
    pushes = np.empty((len(rings.valence), 3))
    weight = limit_ring_weight(np.arange(int(rings.valence.max(initial=0)) + 1))
    ringed = rings.ringed.astype(np.int32)
    args = rings.means, rings.fields, rings.valence, ringed, weight
    blocks.run(len(pushes), prior_pushes.over(*args, ROWS, pushes))
    return pushes
