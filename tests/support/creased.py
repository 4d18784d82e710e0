"""Meshes with creases, as the array kernels have their connectivity and as the compiled have it."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from pns_common import Mesh
from pns_common.connectivity.creases import with_crease_rows
from pns_common.connectivity.topology import build_topology
from tests.support.kernels import edges_built
from tests.support.meshes import bent, grid, manifolds, soups

# The last one has curves whatever is drawn.
MESHES = manifolds() | soups() | st.just(Mesh(*grid(5, bent)))


def creased(mesh, seed):
    """The connectivity of a mesh, about a third of whose interior edges are creases: both ways."""
    rng, plain = np.random.default_rng(seed), build_topology(mesh.faces, len(mesh.vertices))
    some = rng.random(len(plain.interior)) < 0.3
    topology = with_crease_rows(plain, plain.interior[some])
    return topology, replace(edges_built(mesh), edge_class=topology.edge_class)
