"""Parity compares like with like."""

import pytest

from export.parity import check_parity
from pns_common import ModelError
from tests.support.networks import random_model
from train.models.from_recipe import initial_network
from train.models.recipes import paper


def test_a_file_without_the_checkpoints_vertex_rule_is_refused():
    network = initial_network(paper())
    with pytest.raises(ModelError, match="vertex features None"):
        check_parity(random_model(0), network, vertex_network=network)
