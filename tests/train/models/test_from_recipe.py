from dataclasses import replace

import numpy as np
import pytest
import torch

from pns_common.errors import ParameterError
from train.models.from_recipe import initial_network, initial_vertex_network, recipe_scheme
from train.models.recipe import one_step
from train.models.recipes import general, paper, signed
from train.models.tied import TiedNet


def test_a_scale_free_recipe_has_tied_networks_that_are_silent_before_training():
    for network, features in (
        (initial_network(general()), 18),
        (initial_vertex_network(general()), 10),
    ):
        assert isinstance(network, TiedNet)
        rows = torch.from_numpy(np.random.default_rng(0).normal(size=(7, features))).float()
        assert not network(rows, 1.0).any()


@pytest.mark.parametrize("hidden", [(50, 48), (4,), (0,)])
def test_widths_that_symmetries_do_not_divide_are_refused(hidden):
    """50 came out as 48, and the card said 50."""
    with pytest.raises(ParameterError, match=r"hidden.*multiples of 8.*signed-18"):
        initial_network(replace(general(), hidden=hidden))


def test_only_a_scale_free_recipe_with_a_vertex_rule_makes_a_scale_free_scheme():
    recipe = signed()
    with pytest.raises(ParameterError, match="scale-free"):
        recipe_scheme(recipe, initial_network(recipe), initial_vertex_network(recipe))


def test_one_step_is_refused_where_a_recipe_trains_to_the_limit():
    assert one_step(paper()).dataset == "ridge-training"
    with pytest.raises(ParameterError, match="one step"):
        one_step(general())
