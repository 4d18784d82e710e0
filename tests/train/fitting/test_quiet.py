"""The quiet term: nothing is asked inside the training set's features, silence far outside."""

import numpy as np
import pytest
import torch
import trimesh
from pns_common.features.edge_features import FEATURE_SETS

from pns_common import Mesh, ParameterError, clean, load_model, loop, pns, refine
from service.meshes.weld import weld
from tests.support.meshes import grid
from tests.support.shared import shared_path
from train.data.datasets import DATASETS
from train.fitting.quiet import draw_features, quiet_loss, quiet_term, support_of
from train.models.networks import BoundedNet

FEATURES = FEATURE_SETS["paper-5"]


@pytest.fixture(scope="module")
def support():
    meshes = [instance.mesh for instance in DATASETS["ridge-training"]().instances[:3]]
    return support_of(meshes, FEATURES)


def test_features_of_the_training_set_cost_nothing(support):
    network = BoundedNet(5, (8,), "gelu", torch.Generator().manual_seed(0))
    assert quiet_loss(network, support, support.rows).item() == 0
    outside = support.high + 1.0
    assert quiet_loss(network, support, outside[None]).item() > 0


def test_draws_reach_far_outside_the_training_set(support):
    drawn = draw_features(support, torch.Generator().manual_seed(0))
    assert drawn[:, 0].min() >= 0
    assert support.high[0] < drawn[:, 0].max() <= 2
    inside = ((drawn >= support.low) & (drawn <= support.high)).all(dim=1)
    assert 0.1 < inside.float().mean() < 0.9


@pytest.mark.parametrize("name", ["signed-14", "signed-18"])
def test_features_that_see_more_than_an_edge_are_refused_by_name(name):
    with pytest.raises(ParameterError, match=f"quiet.*{name}"):
        quiet_term([Mesh(*grid())], FEATURE_SETS[name], seed=0)


@pytest.mark.parametrize("name", ["Fox", "alien", "RiggedFigure", "low-poly-tree"])
def test_the_paper_model_tears_no_low_poly_asset(name):
    """Right angles and few faces: far from any ridge that the model was trained on."""
    scene = trimesh.load(shared_path(f"assets/{name}.glb"), process=False, force="mesh")
    welded = weld(scene.vertices.astype(np.float32), np.array(scene.faces))
    mesh = clean(Mesh(welded.points, welded.faces)).mesh
    schemes = pns(load_model("paper")), loop()
    report, base = (refine(mesh, scheme, 2).report for scheme in schemes)
    assert [level["flipped_faces"] for level in report["levels"]] == [0, 0]
    jumps = [r["levels"][-1]["normal_jump_max"] for r in (report, base)]
    assert jumps[0] < 1.25 * jumps[1]
