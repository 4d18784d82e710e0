"""A vertex with faces around it, and Loop's step of any mesh with its creases."""

import numpy as np
from pns_common.connectivity.creases import crease_children, with_creases
from pns_common.connectivity.topology import build_topology, split
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices


def star(k, closed, seed=0):
    """A vertex with k faces around it and a second ring of nothing."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, k, endpoint=False) if closed else np.linspace(0, 3, k + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([[[0, 0, 0.3]], ring]) + 0.1 * rng.standard_normal((len(ring) + 1, 3))
    faces = [[0, 1 + j, 1 + (j + 1) % len(ring)] for j in range(k)]
    return points, np.array(faces)


def stepped(points, topology):
    """Loop's step of points and topology; creases stay creases."""
    refined = np.concatenate(
        [loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)]
    )
    after = build_topology(split(topology), len(refined))
    return refined, with_creases(after, crease_children(topology))


def creased(points, faces, seed):
    """The topology with a random third of its edges as creases."""
    topology = build_topology(np.array(faces), len(points))
    rng = np.random.default_rng(seed)
    return with_creases(topology, topology.edges[rng.random(len(topology.edges)) < 1 / 3])
