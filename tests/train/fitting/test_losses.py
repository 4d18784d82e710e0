import numpy as np
import torch
from pns_common.connectivity.topology import build_topology

from train.data.batch import pairs_sharing_a_face
from train.data.datasets import ridge_held_out
from train.fitting.losses import (
    distance_loss,
    fairness_loss,
    normal_loss,
    proximity_loss,
    weighted_loss,
)
from train.models.recipe import LossWeights


def unit_rows(seed, count=6):
    rows = torch.randn(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return rows / rows.norm(dim=-1, keepdim=True)


def test_fairness_pairs_are_the_interior_edges_that_share_a_face():
    mesh = ridge_held_out().instances[0].mesh
    topology = build_topology(np.array(mesh.faces), len(mesh.vertices))
    corners = [set(row) for row in topology.edges[topology.interior].tolist()]
    faces = {frozenset(face) for face in mesh.faces.tolist()}
    expected = {
        (i, j)
        for i in range(len(corners))
        for j in range(i)
        if frozenset(corners[i] | corners[j]) in faces
    }
    sorted_pairs = [(max(pair), min(pair)) for pair in pairs_sharing_a_face(topology).tolist()]
    assert len(sorted_pairs) == len(set(sorted_pairs))
    assert set(sorted_pairs) == expected


def test_fairness_is_zero_for_equal_normals_and_counts_only_its_pairs():
    normals = unit_rows(0)
    equal = normals[:1].expand(6, 3)
    assert fairness_loss(equal, np.array([[0, 5], [1, 2]])) == 0
    pairs = np.array([[0, 3]])
    expected = (normals[0] - normals[3]).square().sum()
    torch.testing.assert_close(fairness_loss(normals, pairs), expected)


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


def test_each_weight_counts_its_own_term():
    distance, ratio = torch.tensor([0.1, -0.2]), torch.tensor([0.5, 1.0])
    normals, target = unit_rows(1, 2).float(), unit_rows(2, 2).float()
    pairs = np.array([[0, 1]])
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
