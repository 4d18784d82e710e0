"""Edges of a coarse mesh that are sharp in truth: the first lesson of the sharpness network.

Where the true sharp edges are known, each point of them counts for the coarse edge that is nearest
to it and runs along it; an edge is sharp if such points cover most of it. Where only points and
normals are known, an edge is sharp if the true normals right on its two sides differ by much more
than on either side alone.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from pns_common import Mesh
from pns_common.kernels.connectivity import INTERIOR
from pns_common.mesh.normals import measure_faces
from pns_common.parallel import Blocks
from train.data.pairs.references import Pair, Reference, Segments
from train.vectors import angle, dot, norm, unit

# Pieces of each coarse edge by which it is found; the share of its length that is to be covered.
PIECES, COVERED = 4, 0.6

# A true edge runs along a coarse one within so much of the edges' mean length, and this angle.
REACH, ALONG = 0.3, np.cos(np.radians(35))

# A coarse edge that bends less than this keeps nothing sharp, radians.
FLAT = np.radians(10)

# Sides are looked at so far from the edge, over the height of its faces, and twice as far.
BESIDE = 0.1

# The true normals' turn across a sharp edge, at least; the turn on either side over it, at most.
LEAST_TURN, SMOOTH = np.radians(30), 0.35

# Nearest pieces of coarse edges that a true point is compared with.
NEAREST = 12


def coarse_sharp_edges(pair: Pair) -> Bool[np.ndarray, " E"]:
    """Return which edges of the coarse mesh, by first appearance, are sharp in truth."""
    mesh, topology = pair.coarse, pair.coarse.topology()
    edges, beside = topology.edges, topology.face_of(topology.half_edges)
    normals, _ = measure_faces(mesh.vertices, topology, Blocks(), areas=False)
    turn = angle(normals[beside[:, 0]], normals[beside[:, 1]])
    bends = (topology.edge_class == INTERIOR) & (turn > FLAT)
    if pair.sharp is None:
        return bends & _normals_jump(mesh, normals, edges, beside, pair.surface)
    return _covered(pair.coarse.vertices[edges], pair.sharp, bends)


def _covered(
    ends: Float[np.ndarray, "E 2 3"], sharp: Segments, bends: Bool[np.ndarray, " E"]
) -> Bool[np.ndarray, " E"]:
    """Return which edges true sharp edges run along."""
    able = np.flatnonzero(bends)
    if len(sharp) == 0 or len(able) == 0:
        return np.zeros(len(ends), dtype=bool)
    ends = ends[able]
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
    sharp_ones = np.zeros(len(bends), dtype=bool)
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


def _normals_jump(
    mesh: Mesh,
    normals: Float[np.ndarray, "F 3"],
    edges: Int[np.ndarray, "E 2"],
    beside: Int[np.ndarray, "E 2"],
    surface: Reference,
) -> Bool[np.ndarray, " E"]:
    """Return at which edges the true normals jump, seen from three points of each edge."""
    tree, degrees = KDTree(surface.points), np.diff(mesh.offsets)
    first, second = mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]]
    along, votes = unit(second - first), np.zeros(len(edges))
    sums = np.add.reduceat(mesh.vertices[mesh.corners], mesh.offsets[:-1])
    others = (degrees - 2)[beside][..., None]
    apex = (sums[beside] - (first + second)[:, None]) / others
    inward = np.cross(normals[beside], along[:, None])
    height = dot(apex - first[:, None], inward)[..., None]
    for share in (0.25, 0.5, 0.75):
        foot = (first + share * (second - first))[:, None]
        near, far = (
            surface.normals[tree.query(foot + step * BESIDE * height * inward)[1]]
            for step in (1, 3)
        )
        across = angle(near[:, 0], near[:, 1])
        within = angle(near, far).max(axis=1)
        votes += (across > LEAST_TURN) & (within < SMOOTH * across)
    return votes >= 2
