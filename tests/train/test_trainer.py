from dataclasses import replace

import numpy as np
import pytest
import torch

from train.batch import disjoint_union
from train.datasets import ridge_training
from train.determinism import deterministic, machine_fingerprint
from train.recipe_operator import initial_network
from train.recipes import RECIPES, paper_text, ridge
from train.trainer import batch_loss, fit


def ignore(done, loss):
    pass


def short(recipe, steps=4):
    return replace(recipe, steps=steps)


@pytest.mark.parametrize("name", RECIPES)
def test_same_seed_same_bits(name):
    recipe = short(RECIPES[name](3))
    torch.manual_seed(1)
    first = fit(recipe, ignore)
    torch.manual_seed(2)
    again = fit(recipe, ignore)
    assert first.losses == again.losses
    for one, other in zip(first.network.parameters(), again.network.parameters(), strict=True):
        assert torch.equal(one, other)


@pytest.mark.parametrize("recipe", [ridge, paper_text])
def test_another_seed_gives_another_network(recipe):
    assert fit(short(recipe(0), 2), ignore).losses != fit(short(recipe(1), 2), ignore).losses


def test_training_lowers_the_loss_and_reports_every_step():
    reports = []
    # Without the quiet term, which is drawn anew at each step and would blur the comparison.
    recipe = replace(short(ridge(), 20), quiet=0.0)
    trained = fit(recipe, lambda done, loss: reports.append((done, loss)))
    assert [done for done, _ in reports] == list(range(1, 21))
    assert tuple(loss for _, loss in reports) == trained.losses
    assert trained.losses[-1] < 0.8 * trained.losses[0]


def test_loss_of_a_union_is_the_mean_over_its_meshes():
    recipe = ridge()
    network = initial_network(recipe).double()
    instances = ridge_training().instances[:3]
    whole = batch_loss(recipe, network, disjoint_union(instances)).item()
    alone = [batch_loss(recipe, network, disjoint_union([one])).item() for one in instances]
    assert whole == pytest.approx(np.mean(alone), rel=1e-12)


def test_training_leaves_torchs_settings_as_they_were():
    before = torch.are_deterministic_algorithms_enabled(), torch.get_num_threads()
    with deterministic():
        assert torch.are_deterministic_algorithms_enabled()
    fit(short(ridge(), 1), ignore)
    assert (torch.are_deterministic_algorithms_enabled(), torch.get_num_threads()) == before


def test_fingerprint_is_stable():
    assert machine_fingerprint() == machine_fingerprint()
    assert len(machine_fingerprint()) == 16
