import numpy as np
import torch
from pns_common.connectivity.topology import build_topology, split
from pns_common.refine import refine
from train.fitting.one_step import refine_once, vertex_normals

from pns_common.schemes import pns
from train.data.datasets import ridge_held_out
from train.models.from_recipe import initial_network, recipe_operator
from train.models.recipes import paper
from train.models.torch_model import recipe_model


def one_step(points, topology, network, budget=0.5):
    return refine_once(points, topology, recipe_operator(paper(), network), budget)


def example():
    mesh = ridge_held_out().instances[0].mesh
    topology = build_topology(np.array(mesh.faces), len(mesh.vertices))
    return mesh, torch.from_numpy(np.array(mesh.vertices)), topology


def test_training_step_is_the_products_step():
    mesh, points, topology = example()
    network = initial_network(paper()).double()
    step = one_step(points, topology, network)
    scheme = pns(recipe_model(paper(), network), budget=0.5)
    refinement = refine(mesh, scheme, levels=1, reference_length=1.0)
    np.testing.assert_allclose(step.points.detach(), refinement.mesh.vertices, rtol=0, atol=1e-14)
    edge_ratio = refinement.ratio[topology.vertex_count + topology.interior]
    np.testing.assert_allclose(step.ratio.detach(), edge_ratio, rtol=0, atol=1e-14)
    assert (edge_ratio > 0.05).any()


def test_gradient_flows_through_points_and_weights():
    _, points, topology = example()
    network = initial_network(paper()).double()
    weights = torch.randn(
        len(topology.edges) + topology.vertex_count,
        3,
        dtype=torch.float64,
        generator=torch.Generator().manual_seed(0),
    )

    def objective(points):
        return (weights * one_step(points, topology, network).points).sum()

    points.requires_grad_()
    (gradient,) = torch.autograd.grad(objective(points), points)
    direction = torch.randn(
        points.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1)
    )
    h = 1e-6
    with torch.no_grad():
        ahead, behind = objective(points + h * direction), objective(points - h * direction)
    slope = ((ahead - behind) / (2 * h)).item()
    assert abs((gradient * direction).sum().item() - slope) < 1e-5 * abs(slope)
    objective(points.detach()).backward()
    assert all(parameter.grad.abs().max() > 0 for parameter in network.parameters())


def test_vertex_normals_of_a_tilted_plane_are_its_normal():
    mesh, points, topology = example()
    tilted = points.detach().clone()
    tilted[:, 2] = 2 * tilted[:, 0] - tilted[:, 1]
    expected = torch.tensor([-2.0, 1.0, 1.0], dtype=torch.float64) / 6**0.5
    normals = vertex_normals(tilted, topology.faces)
    torch.testing.assert_close(normals, expected.expand(len(tilted), 3), rtol=0, atol=1e-14)
    assert len(split(topology)) == 4 * len(mesh.faces)
