"""The geometry is written once: numpy and torch agree, and torch differentiates through it."""

import numpy as np
import torch
from hypothesis import given

from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import paper_features
from pns_common.formula.correction import correct, curvature_gate
from pns_common.geometry.frames import edge_stencil, face_normals
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from tests.support.meshes import bumpy_sphere, manifolds, soups

WEIGHTS = np.random.default_rng(0).standard_normal((5, 3))


def step(points, topology, xp):
    """Displacements and Loop vertices of one step on either backend."""
    weights = xp.asarray(WEIGHTS)
    rows = topology.interior
    normals = face_normals(points, topology.faces)
    stencil = edge_stencil(points, normals, topology.stencil[rows], topology.edge_faces[rows])
    result = correct(
        stencil, paper_features, lambda f: xp.tanh(f @ weights), curvature_gate(10.0), 0.5
    )
    old, new = loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)
    return result.displacement, result.gate, old, new


@given(soups() | manifolds())
def test_numpy_and_torch_agree(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    ours = step(mesh.vertices, topology, np)
    theirs = step(torch.tensor(mesh.vertices), topology, torch)
    scale = max(1.0, np.abs(mesh.vertices).max()) ** 2
    for own, twin in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(own, twin.numpy(), rtol=1e-12, atol=1e-12 * scale)


def test_torch_differentiates_through_the_step():
    vertices, faces = bumpy_sphere(0, subdivisions=0)
    topology = build_topology(faces, len(vertices))
    points = torch.tensor(vertices, requires_grad=True)
    assert torch.autograd.gradcheck(lambda p: step(p, topology, torch), (points,), fast_mode=True)


@given(soups())
def test_gradients_are_finite_on_degenerate_meshes(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    points = torch.tensor(mesh.vertices / np.abs(mesh.vertices).max(), requires_grad=True)
    sum(part.sum() for part in step(points, topology, torch)).backward()
    assert torch.isfinite(points.grad).all()
