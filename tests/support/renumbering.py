"""Meshes with other numbers, mirrored or turned over, and which new vertex is which."""

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from pns_common import Mesh, clean
from pns_common.mesh.reference_length import measure_reference_length
from pns_common.mesh.topology import build_topology
from tests.support.shared import shared_path

# One of each kind, by their edges.
CLOSED, WITH_RIM, IRREGULAR = (
    "fish_control_mesh.obj",
    "barrel_large_decorated.glb",
    "cakeBirthday.glb",
)
ONE_SIDED = "moebius.obj"
# All else that trimesh reads of the shared meshes.
OTHERS = [
    "AnimatedMorphSphere.glb",
    "Fox.glb",
    "Knight.glb",
    "MorphStressTest.glb",
    "RiggedFigure.glb",
    "alien.glb",
    "cow.glb",
    "frostAxe.glb",
    "fuze.ply",
    "lego.ply",
    "low-poly-tree.glb",
    "penguin_control_mesh.obj",
    "spot_control_mesh.obj",
]
ASSETS = [
    *(CLOSED, WITH_RIM, IRREGULAR, ONE_SIDED),
    *(pytest.param(name, marks=pytest.mark.exhaustive) for name in OTHERS),
]

MIRROR = np.array([-1.0, 1, 1])


def asset(name):
    """A shared mesh, welded and cleaned, centred, of reference length 1."""
    path = shared_path(f"assets/{name}")
    # fuze.ply names a picture that is not there.
    loaded = trimesh.load(path, process=False, force="mesh", skip_materials=True)
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    mesh = clean(Mesh(np.asarray(loaded.vertices), np.asarray(loaded.faces))).mesh
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    return Mesh(centred / measure_reference_length(mesh.vertices, mesh.corners), mesh.faces)


@dataclass(frozen=True, eq=False)
class Twin:
    """The same mesh otherwise; ``place`` tells which refined vertex of it is which of the first."""

    mesh: Mesh
    place: np.ndarray


def renumbered(mesh, seed):
    """Vertices relabelled, faces reordered and rotated."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[order] = mesh.vertices
    faces = order[mesh.faces][rng.permutation(len(mesh.faces))]
    start = rng.integers(0, 3, len(faces))
    rotated = np.stack([faces[np.arange(len(faces)), (start + i) % 3] for i in range(3)], axis=1)
    return _twin(mesh, Mesh(vertices, rotated), order)


def mirrored(mesh):
    """Reflected in x, faces turned so that they stay outside."""
    return turned_over(Mesh(mesh.vertices * MIRROR, mesh.faces))


def turned_over(mesh):
    """Every face in the other direction."""
    return _twin(mesh, Mesh(mesh.vertices, mesh.faces[:, ::-1]), np.arange(len(mesh.vertices)))


def _twin(mesh, other, order):
    count = len(mesh.vertices)
    theirs = build_topology(other.faces, count).edges
    number = {tuple(edge): e for e, edge in enumerate(theirs.tolist())}
    ours = np.sort(order[build_topology(mesh.faces, count).edges], axis=1)
    edges = np.array([number[tuple(edge)] for edge in ours.tolist()], dtype=np.int64)
    return Twin(other, np.concatenate([order, count + edges]))
