from dataclasses import replace

import msgspec
import numpy as np
import pytest
import torch

from tests.support.recipes import tiny
from train.data.batch import disjoint_union
from train.data.datasets import ridge_training
from train.fitting.determinism import deterministic, machine_fingerprint
from train.fitting.trainer import batch_loss, fit
from train.models.from_recipe import initial_network
from train.models.recipes import RECIPES, paper, paper_text


def ignore(done, loss):
    pass


@pytest.mark.parametrize("name", RECIPES)
def test_same_seed_same_bits(name):
    recipe = tiny(RECIPES[name](3))
    torch.manual_seed(1)
    first = fit(recipe, ignore)
    torch.manual_seed(2)
    again = fit(recipe, ignore)
    assert first.losses == again.losses
    for weight, retrained in zip(
        first.network.parameters(), again.network.parameters(), strict=True
    ):
        assert torch.equal(weight, retrained)


@pytest.mark.parametrize("recipe", [paper, paper_text])
def test_another_seed_gives_another_network(recipe):
    assert fit(tiny(recipe(0), 2), ignore).losses != fit(tiny(recipe(1), 2), ignore).losses


def test_training_lowers_the_loss_and_reports_every_step():
    reports = []
    # Without the quiet term, which is drawn anew at each step and would blur the comparison.
    base = tiny(paper(), 20)
    recipe = replace(base, training=msgspec.structs.replace(base.training, quiet=0.0))
    trained = fit(recipe, lambda done, loss: reports.append((done, loss)))
    assert [done for done, _ in reports] == list(range(1, 21))
    assert tuple(loss for _, loss in reports) == trained.losses
    assert trained.losses[-1] < 0.8 * trained.losses[0]


def test_loss_of_a_union_is_the_mean_over_its_meshes():
    recipe = paper()
    network = initial_network(recipe).double()
    instances = ridge_training().instances[:3]
    whole = batch_loss(recipe, network, disjoint_union(instances)).item()
    alone = [
        batch_loss(recipe, network, disjoint_union([instance])).item() for instance in instances
    ]
    assert whole == pytest.approx(np.mean(alone), rel=1e-12)


def test_training_leaves_torchs_settings_as_they_were():
    before = torch.are_deterministic_algorithms_enabled(), torch.get_num_threads()
    with deterministic():
        assert torch.are_deterministic_algorithms_enabled()
    fit(tiny(paper(), 1), ignore)
    assert (torch.are_deterministic_algorithms_enabled(), torch.get_num_threads()) == before


def test_fingerprint_is_stable():
    assert machine_fingerprint() == machine_fingerprint()
    assert len(machine_fingerprint()) == 16
