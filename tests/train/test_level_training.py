"""Training through levels: what is rolled out is the product, and the loss means what it says."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch

from pns_common import loop, pns, refine
from train.datasets import Instance
from train.level_loss import AGAINST_LOOP, level_loss, measure, references, rollout_loss
from train.level_trainer import depth, fit_through_levels
from train.recipe_operator import (
    initial_network,
    initial_vertex_network,
    recipe_operator,
    vertex_rule_operator,
)
from train.recipes import Polish, full
from train.rollout import level_batch, loop_rollout, rollout
from train.shape_metrics import nearest_points
from train.stream import stream
from train.surface_union import surface_union
from train.surfaces import signed_distance, unit_normal
from train.torch_model import recipe_model
from train.trainer import fit

RECIPE = full(3)


@pytest.fixture(scope="module")
def instances():
    return list(islice(stream(5), 6))


@pytest.fixture(scope="module")
def batch(instances):
    return level_batch(instances, len(RECIPE.stream.levels))


def test_points_of_many_families_are_each_measured_against_their_own(instances):
    owner = np.random.default_rng(0).integers(0, len(instances), 200)
    points = np.random.default_rng(1).uniform(0.3, 0.9, (200, 3))
    union = surface_union([one.surface for one in instances], owner)
    found = signed_distance(union, torch.from_numpy(points))
    normals = unit_normal(union, torch.from_numpy(points))
    for index, one in enumerate(instances):
        own = owner == index
        np.testing.assert_allclose(
            found[own], signed_distance(one.surface, points[own]), rtol=0, atol=1e-12
        )
        np.testing.assert_allclose(
            normals[own], unit_normal(one.surface, points[own]), rtol=0, atol=1e-12
        )


def test_the_rollout_is_the_products_refinement(instances, batch):
    network, vertex_network = initial_network(RECIPE), initial_vertex_network(RECIPE)
    operator = recipe_operator(RECIPE, network)
    vertices = vertex_rule_operator(RECIPE.vertex, vertex_network)
    with torch.no_grad():
        found = rollout(batch, operator, RECIPE.budget, vertices)
    scheme = pns(recipe_model(RECIPE, network, vertex_network))
    for level, points in enumerate(found, start=1):
        owner = batch.levels[level - 1].vertex_owner
        for index, one in enumerate(instances):
            expected = refine(one.mesh, scheme, level, 1.0).mesh.vertices
            np.testing.assert_allclose(points[owner == index], expected, rtol=0, atol=1e-5)


def test_loops_rollout_is_loop(instances, batch):
    for level, points in enumerate(loop_rollout(batch), start=1):
        owner = batch.levels[level - 1].vertex_owner
        expected = refine(instances[2].mesh, loop(), level, 1.0).mesh.vertices
        np.testing.assert_allclose(points[owner == 2], expected, rtol=0, atol=1e-6)


def test_loop_itself_costs_its_weights_and_nothing_for_jumps(batch):
    weights = RECIPE.stream.levels
    points = loop_rollout(batch)
    total = rollout_loss(weights, batch, points, references(batch))
    expected = sum(getattr(one, name) for one in weights for name in AGAINST_LOOP)
    assert float(total) == pytest.approx(expected, rel=1e-4)


def test_points_on_the_surface_cost_less_and_worse_ones_more(instances, batch):
    level, loops = batch.levels[0], loop_rollout(batch)[0]
    reference = references(batch)[0]
    on_surface, off_surface = loops.clone(), loops.clone()
    for index, one in enumerate(instances):
        own = torch.from_numpy(level.vertex_owner == index)
        nearest = torch.from_numpy(nearest_points(one.surface, loops[own].double().numpy()))
        on_surface[own] = nearest.to(loops.dtype)
        off_surface[own] = loops[own] + (loops[own] - on_surface[own])
    cost = [
        float(level_loss(RECIPE.stream.levels[0], measure(level, p, batch.count), reference))
        for p in (on_surface, loops, off_surface)
    ]
    assert cost[0] < 0.7 * cost[1]
    assert cost[2] > 1.5 * cost[1]


def test_a_rough_surface_pays_for_its_jumps(batch):
    level, points = batch.levels[1], loop_rollout(batch)[1]
    reference = references(batch)[1]
    noise = 3e-3 * torch.randn(points.shape, generator=torch.Generator().manual_seed(0))
    only_jumps = replace(
        RECIPE.stream.levels[1], distance=0, peak=0, inserted=0, inserted_peak=0, normal=0
    )
    smooth, rough = (
        float(level_loss(only_jumps, measure(level, p, batch.count), reference))
        for p in (points, points + noise)
    )
    assert smooth == 0
    assert rough > 1


def test_the_deepest_level_is_seen_now_and_then_on_fewer_meshes():
    plan = RECIPE.stream
    taken = [depth(plan, 8, step) for step in range(plan.deepest_every)]
    assert taken[0] == (plan.levels, 2)
    assert taken[1:] == [(plan.levels[:-1], 8)] * (plan.deepest_every - 1)


def test_the_same_seed_trains_the_same_bits_and_another_does_not():
    plan = replace(RECIPE.stream, star_shares=((4, 1.0),))
    short = replace(RECIPE, steps=3, batch_size=3, stream=plan, polish=Polish(plan, 2, 1e-3))
    once, again = (fit(short, lambda done, loss: None) for _ in range(2))
    other = fit(replace(short, seed=4), lambda done, loss: None)
    assert once.losses == again.losses
    assert len(once.losses) == 5
    for one, same, new in zip(
        once.vertex_network.parameters(),
        again.vertex_network.parameters(),
        other.vertex_network.parameters(),
        strict=True,
    ):
        assert torch.equal(one, same)
        assert not torch.equal(one, new)


def test_a_little_training_lowers_the_loss():
    two_levels = replace(RECIPE.stream, levels=RECIPE.stream.levels[:2], deepest_every=1, star=0.0)
    short = replace(RECIPE, steps=25, batch_size=16, stream=two_levels, polish=None)
    _, _, losses = fit_through_levels(short, lambda done, loss: None)
    assert np.mean(losses[-5:]) < 0.95 * np.mean(losses[:5])


def test_training_leaves_isolated_vertices_alone(instances):
    mesh = instances[0].mesh
    padded = type(mesh)(np.concatenate([mesh.vertices, [[0.0, 0.0, 0.5]]]), mesh.faces)
    batch = level_batch([Instance(instances[0].surface, padded)], 1)
    assert torch.isfinite(
        rollout_loss(RECIPE.stream.levels[:1], batch, loop_rollout(batch), references(batch))
    )
