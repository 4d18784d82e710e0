"""Which edges of a coarse mesh are sharp in the surface that it stands for."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pns_common import Mesh
from train.connectivity import connect

# Where along an edge the surface is looked at, and how far beside it, in the shorter height of both
# faces over the edge.
ALONG = (0.3, 0.5, 0.7)
BESIDE = (0.02, 0.07, 0.13, 0.22, 0.35)
# The surface turns by less than GENTLE, or by more than CLEAR, radians.
GENTLE, CLEAR = np.radians(12), np.radians(25)
# An edge takes at least this share of all turns beside it.
SHARE = 0.6


def truly_sharp(
    mesh: Mesh, tree: KDTree, normals: Float[np.ndarray, "S 3"]
) -> Float[np.ndarray, " E"]:
    """Return the share of places at which an edge is sharp; NaN where there is no clear one.

    The surface is read along a line across the edge. It is sharp where it turns by more than 25
    degrees from one reading to the next, and this is most of what it turns altogether.

    Args:
        tree: of points on the surface.
        normals: there.
    """
    level = connect(mesh.faces, len(mesh.vertices))
    rows = np.flatnonzero(level.paired.numpy())
    points = mesh.vertices
    ends = points[level.edges.numpy()[rows]]
    along = ends[:, 1] - ends[:, 0]
    square = np.maximum((along**2).sum(axis=1, keepdims=True), 1e-300)
    ways = []
    for side in (0, 1):
        away = points[level.opposites.numpy()[rows, side]] - ends[:, 0]
        ways.append(away - (away * along).sum(axis=1, keepdims=True) / square * along)
    heights = [np.linalg.norm(way, axis=1, keepdims=True) for way in ways]
    reach = np.minimum(np.minimum(*heights), np.sqrt(square))
    ways = [reach * way / np.maximum(height, 1e-300) for way, height in zip(ways, heights, strict=True)]
    line = [step * ways[0] for step in reversed(BESIDE)] + [step * ways[1] for step in BESIDE]
    votes = []
    for share in ALONG:
        middle = ends[:, 0] + share * along
        seen = normals[tree.query(np.concatenate([middle + step for step in line]))[1]]
        seen = seen.reshape(len(line), -1, 3)
        turns = np.arccos(np.clip((seen[1:] * seen[:-1]).sum(axis=2), -1, 1))
        total, most = turns.sum(axis=0), turns.max(axis=0)
        vote = np.where(most < GENTLE, 0.0, np.nan)
        vote = np.where((most > CLEAR) & (most > SHARE * total), 1.0, vote)
        votes.append(np.where((most > GENTLE) & (most < SHARE / 2 * total), 0.0, vote))
    made = np.full(len(level.edges), np.nan)
    made[rows] = np.median(votes, axis=0)
    return made
