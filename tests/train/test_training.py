"""Training on one step: its losses, the quiet term, the same bits again, and work made ahead."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
import torch
import trimesh

from pns_common import Mesh, ParameterError, clean, load_model, loop, pns
from tests.support.control_points import refine
from tests.support.meshes import grid
from tests.support.shared import shared_path
from train.connectivity import connect
from train.data.batch import pairs_sharing_a_face
from train.data.datasets import ridge_held_out
from train.fitting.quiet import quiet_term
from train.fitting.trainer import (
    distance_loss,
    fairness_loss,
    fit,
    normal_loss,
    proximity_loss,
    weighted_loss,
)
from train.models.from_recipe import initial_network, paper_rule
from train.models.recipe import LossWeights, of_length
from train.models.recipes import RECIPES, paper
from train.models.torch_model import recipe_model


def unit_rows(seed, count=6):
    rows = torch.randn(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return rows / rows.norm(dim=-1, keepdim=True)


def test_fairness_pairs_are_the_interior_edges_that_share_a_face():
    mesh = ridge_held_out().instances[0].mesh
    level = connect(mesh.faces, len(mesh.vertices))
    corners = [set(row) for row in level.edges[level.interior].tolist()]
    faces = {frozenset(face) for face in mesh.faces.tolist()}
    expected = {
        (i, j)
        for i in range(len(corners))
        for j in range(i)
        if frozenset(corners[i] | corners[j]) in faces
    }
    sorted_pairs = [(max(pair), min(pair)) for pair in pairs_sharing_a_face(level).tolist()]
    assert len(sorted_pairs) == len(set(sorted_pairs))
    assert set(sorted_pairs) == expected


def test_each_weight_counts_its_own_term():
    distance, ratio = torch.tensor([0.1, -0.2]), torch.tensor([0.5, 1.0])
    normals, target = unit_rows(1, 2).float(), unit_rows(2, 2).float()
    pairs = torch.tensor([[0, 1]])
    terms = {
        "distance": distance_loss(distance),
        "normal": normal_loss(normals, target),
        "fairness": fairness_loss(normals, pairs),
        "proximity": proximity_loss(ratio),
    }
    for name, term in terms.items():
        weights = LossWeights(**{other: float(other == name) * 2 for other in terms})
        loss = weighted_loss(weights, distance, normals, target, ratio, pairs)
        torch.testing.assert_close(loss, 2 * term)


def test_the_training_step_is_the_products_step():
    mesh, network = ridge_held_out().instances[0].mesh, initial_network(paper()).double()
    level = connect(mesh.faces, len(mesh.vertices))
    step = paper_rule(paper(), network)(torch.tensor(mesh.vertices), level)
    refined = refine(mesh, pns(recipe_model(paper(), network), 0.5), 1, 1.0)
    np.testing.assert_allclose(step.points.detach(), refined.mesh.vertices, rtol=0, atol=1e-14)
    np.testing.assert_allclose(step.ratio.detach(), refined.ratio, rtol=0, atol=1e-13)
    assert (refined.ratio > 0.05).any()
    step.points.square().sum().backward()
    assert all(parameter.grad.abs().max() > 0 for parameter in network.parameters())


def test_features_that_see_more_than_an_edge_are_refused_by_name():
    with pytest.raises(ParameterError, match=r"quiet.*signed-18"):
        quiet_term([Mesh(*grid())], "signed-18", seed=0)


@pytest.mark.parametrize("name", ["Fox", "alien", "RiggedFigure", "low-poly-tree"])
def test_the_paper_model_tears_no_low_poly_asset(name):
    """Right angles and few faces: far from any ridge that the model was trained on."""
    scene = trimesh.load(shared_path(f"assets/{name}.glb"), process=False, force="mesh")
    scene.merge_vertices(merge_tex=True, merge_norm=True)
    mesh = clean(Mesh(np.asarray(scene.vertices), np.asarray(scene.faces))).mesh
    schemes = pns(load_model("paper")), loop()
    report, base = (refine(mesh, scheme, 2).report for scheme in schemes)
    assert [level["flipped_faces"] for level in report["levels"]] == [0, 0]
    jumps = [r["levels"][-1]["normal_jump_max"] for r in (report, base)]
    assert jumps[0] < 1.25 * jumps[1]


def ignore(done, loss):
    pass


# Those that read a folder of shapes: test_directed_training.
@pytest.mark.parametrize("name", sorted(RECIPES.keys() - {"general", "general-quad"}))
def test_same_seed_same_bits(name):
    recipe = of_length(RECIPES[name](3), 4)
    torch.manual_seed(1)
    first = fit(recipe, ignore)
    torch.manual_seed(2)
    again = fit(recipe, ignore)
    assert first.losses == again.losses
    for weight, retrained in zip(
        first.network.parameters(), again.network.parameters(), strict=True
    ):
        assert torch.equal(weight, retrained)


def test_training_lowers_the_loss_and_reports_every_step():
    reports = []
    # Without the quiet term, which is drawn anew at each step and would blur the comparison.
    base = of_length(paper(), 20)
    recipe = replace(base, training=msgspec.structs.replace(base.training, quiet=0.0))
    trained = fit(recipe, lambda done, loss: reports.append((done, loss)))
    assert [done for done, _ in reports] == list(range(1, 21))
    assert tuple(loss for _, loss in reports) == trained.losses
    assert trained.losses[-1] < 0.8 * trained.losses[0]


def test_normal_loss_is_one_minus_the_cosine():
    angle = torch.tensor([0.0, 0.3, np.pi], dtype=torch.float64)
    zero = torch.zeros(3, dtype=torch.float64)
    normals = torch.stack([angle.sin(), zero, angle.cos()], dim=-1)
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64).expand(3, 3)
    expected = (1 - angle.cos()).mean()
    torch.testing.assert_close(normal_loss(normals, up), expected, rtol=0, atol=1e-15)


def test_distance_and_proximity_are_mean_squares():
    values = torch.tensor([3.0, -4.0])
    assert distance_loss(values) == 12.5
    assert proximity_loss(values) == 12.5
