"""Training stays on one device from end to end.

On torch's device without values every operation checks its operands' devices as a GPU would: a
constant left behind on the processor is an error.
"""

from itertools import islice

import pytest

import pns_common.correction
import pns_common.vertex_operator
from train.level_loss import references, rollout_loss
from train.recipe_operator import (
    initial_network,
    initial_vertex_network,
    recipe_operator,
    vertex_rule_operator,
)
from train.recipes import full
from train.rollout import level_batch, rollout
from train.star_term import perturbed_points, star_copies, star_jacobian
from train.stream import stream

DEVICE = "meta"
RECIPE = full(0)


@pytest.fixture
def rules(monkeypatch):
    for module in (pns_common.correction, pns_common.vertex_operator):
        # It looks at values, of which there are none.
        monkeypatch.setattr(module, "finite", lambda eta, like: eta.to(like.dtype))
    network, vertex_network = initial_network(RECIPE), initial_vertex_network(RECIPE)
    return (
        recipe_operator(RECIPE, network.to(DEVICE)),
        RECIPE.budget,
        vertex_rule_operator(RECIPE.vertex, vertex_network.to(DEVICE)),
    )


def test_levels_and_their_loss(rules):
    levels = RECIPE.stream.levels[:2]
    batch = level_batch(list(islice(stream(5), 6)), len(levels), DEVICE)
    points = rollout(batch, *rules)
    loss = rollout_loss(levels, batch, points, references(batch))
    assert {one.device.type for one in (*points, loss)} == {DEVICE}


def test_stars(rules):
    copies = star_copies(4)
    matrix = star_jacobian(copies, perturbed_points(copies, 0.3).to(DEVICE), *rules)
    assert matrix.device.type == DEVICE


def test_what_stays_behind_is_found(rules):
    copies = star_copies(4)
    with pytest.raises(RuntimeError, match="device"):
        star_jacobian(copies, perturbed_points(copies, 0.3), *rules)
