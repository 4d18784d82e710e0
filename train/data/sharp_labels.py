"""Edges of a coarse mesh that are sharp in truth.

Each point of the true sharp edges counts for the coarse edge that is nearest to it and runs along
it; a coarse edge is sharp if such points cover most of it.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from pns_common import Mesh
from pns_common.kernels.connectivity import INTERIOR
from pns_common.mesh.normals import measure_faces
from pns_common.parallel import Blocks
from train.connectivity import connect
from train.vectors import angle, face_normals, norm, unit

# Ends of pieces of sharp edges.
Segments = Float[np.ndarray, "S 2 3"]

# Pieces of each coarse edge by which it is found; the share of its length that is to be covered.
PIECES, COVERED = 4, 0.6

# A true edge runs along a coarse one within so much of the edges' mean length, and this angle.
REACH, ALONG = 0.3, np.cos(np.radians(35))

# A coarse edge that bends less than this keeps nothing sharp, radians.
FLAT = np.radians(10)

# Nearest pieces of coarse edges that a true point is compared with.
NEAREST = 12


def sharp_edges(mesh: Mesh, least: float) -> Segments:
    """Return the interior edges of a mesh that turn by more than an angle, radians."""
    level, normals = (
        connect(mesh.faces, len(mesh.vertices)),
        face_normals(mesh.vertices, mesh.faces),
    )
    left, right = level.half_edges.numpy().T // 3
    sharp = level.paired.numpy() & (angle(normals[left], normals[right]) > least)
    return mesh.vertices[level.edges.numpy()[sharp]]


def coarse_sharp_edges(mesh: Mesh, sharp: Segments) -> Bool[np.ndarray, " E"]:
    """Return which edges of a coarse mesh, by first appearance, true sharp edges run along."""
    topology = mesh.topology()
    beside = topology.face_of(topology.half_edges)
    normals, _ = measure_faces(mesh.vertices, topology, Blocks(), areas=False)
    bends = angle(normals[beside[:, 0]], normals[beside[:, 1]]) > FLAT
    able = np.flatnonzero((topology.edge_class == INTERIOR) & bends)
    sharp_ones = np.zeros(len(bends), dtype=bool)
    if len(sharp) == 0 or len(able) == 0:
        return sharp_ones
    ends = mesh.vertices[topology.edges[able]]
    span = ends[:, 1] - ends[:, 0]
    length = norm(span)
    reach = REACH * float(norm(span).mean())
    share = (np.arange(PIECES) + 0.5) / PIECES
    middles = (ends[:, None, 0] + share[:, None] * span[:, None]).reshape(-1, 3)
    points, ways, weights = _points_along(sharp, float(np.median(length)) / PIECES)
    _, piece = KDTree(middles).query(points, min(NEAREST, len(middles)))
    edge = piece.reshape(len(points), -1) // PIECES
    along = np.abs((unit(span)[edge] * ways[:, None]).sum(axis=2)) > ALONG
    offset = points[:, None] - ends[edge, 0]
    place = (offset * span[edge]).sum(axis=2) / np.maximum(length[edge] ** 2, 1e-300)
    away = norm(offset - np.clip(place, 0, 1)[..., None] * span[edge])
    # A short edge's true line is no farther than its own length lets it be.
    away = np.where(along & (away < np.minimum(reach, length[edge] / 2)), away, np.inf)
    best = away.argmin(axis=1)[:, None]
    found = np.isfinite(np.take_along_axis(away, best, axis=1))[:, 0]
    nearest = np.take_along_axis(edge, best, axis=1)[found, 0]
    covered = np.bincount(nearest, weights[found], len(ends))
    sharp_ones[able] = covered >= COVERED * length
    return sharp_ones


def _points_along(
    sharp: Segments, spacing: float
) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"], Float[np.ndarray, " P"]]:
    """Return points on segments, the segments' directions, and the length each stands for."""
    span = sharp[:, 1] - sharp[:, 0]
    count = np.maximum(np.ceil(norm(span) / spacing), 1).astype(int)
    owner = np.repeat(np.arange(len(sharp)), count)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    share = ((place + 0.5) / count[owner])[:, None]
    return sharp[owner, 0] + share * span[owner], unit(span)[owner], (norm(span) / count)[owner]
