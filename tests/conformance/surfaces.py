"""Welding, counting and Loop subdivision, independent of the package, for the conformance tests."""

import numpy as np
import trimesh


def welded(primitives):
    """(points, faces) of a mesh, joined where position, morph deltas and joints are all equal."""
    joints = 1 + int(max((p["joints"].max(initial=0) for p in primitives), default=0))
    targets = max((len(p["targets"]) for p in primitives), default=0)
    rows, faces, start = [], [], 0
    for p in primitives:
        count = len(p["points"])
        bound = np.zeros((count, joints))
        if len(p["joints"]):
            np.add.at(bound, (np.arange(count)[:, None], p["joints"].astype(int)), p["weights"])
        deltas = [*p["targets"], *[np.zeros((count, 3))] * (targets - len(p["targets"]))]
        rows.append(np.hstack([p["points"], *deltas, bound.astype(np.float32)]))
        faces.append(p["faces"] + start)
        start += count
    table = np.concatenate(rows).astype(np.float64) + 0.0
    table, vertex = np.unique(table, axis=0, return_inverse=True)
    return table[:, :3], vertex.reshape(-1)[np.concatenate(faces)]


def proper(faces):
    """Return which faces have three different vertices."""
    return (faces != np.roll(faces, 1, axis=1)).all(axis=1)


def open_edges(faces):
    """Return how many edges have one face; a face counts once, however often it is there."""
    distinct = np.unique(np.sort(faces[proper(faces)], axis=1), axis=0)
    edges = np.sort(distinct[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return int((np.unique(edges, axis=0, return_counts=True)[1] == 1).sum())


def loop_step(points, faces):
    """(corners, sure): a, b, c, ab, bc, ca of each face after one step of trimesh's Loop.

    `sure` are the faces for which trimesh can be trusted: in components that are manifold and
    consistently wound, and where no boundary is near (it mistakes a neighbour on a boundary for a
    boundary neighbour).
    """
    expected, sure = np.full((len(faces), 6, 3), np.nan), np.zeros(len(faces), dtype=bool)
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, number, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    crowded = (count[number.reshape(-1)] > 1).reshape(-1, 3).any(axis=1)
    component = _components(faces, len(points))
    sound = ~np.isin(component[faces[:, 0]], component[faces[crowded, 0]]) & proper(faces)
    if not sound.any():
        return expected, sure
    kept, inverse = np.unique(faces[sound], return_inverse=True)
    own = inverse.reshape(-1, 3)
    refined, children = trimesh.remesh.subdivide_loop(points[kept], own, iterations=1)
    blocks = refined[children.reshape(-1, 4, 3)]
    expected[sound] = np.concatenate(
        [np.stack([blocks[:, 0, 0], blocks[:, 1, 1], blocks[:, 2, 2]], axis=1), blocks[:, 3]],
        axis=1,
    )
    near = np.zeros(len(kept), dtype=bool)
    pairs = own[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    unordered, number = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
    near[unordered[number == 1]] = True
    for _ in range(2):
        near[unordered[near[unordered].any(axis=1)]] = True
    sure[sound] = ~near[own].any(axis=1)
    return expected, sure


def _components(faces, count):
    """For each vertex the lowest vertex of its component."""
    label = np.arange(count)
    while True:
        least = label[faces].min(axis=1)
        after = label.copy()
        np.minimum.at(after, faces.reshape(-1), np.repeat(least, 3))
        after = after[after]
        if (after == label).all():
            return label
        label = after
