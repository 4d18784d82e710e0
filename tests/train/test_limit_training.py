"""Training to the limit: the step that is trained, its measures, and that a few steps help."""

import pickle
from dataclasses import replace
from itertools import islice

import msgspec
import numpy as np
import pytest
import torch

import pns_common
from pns_common import catmull_clark, loop, pns
from pns_common.schemes import CATMULL_CLARK
from train.certificates.bodies import polygon_bodies
from train.connectivity import connect
from train.data.pairs import pair_stream as stream
from train.data.pairs.grid import grid_pair
from train.data.pairs.references import Pair, Reference
from train.data.primitives import box, globe, icosphere, torus
from train.fitting import limit_trainer
from train.fitting.learned_level import learned_level
from train.fitting.limit_batch import limit_batch, limit_matrix
from train.fitting.limit_loss import limit_loss, measure
from train.fitting.limit_trainer import fit_to_limit, reference_of
from train.fitting.sharp_masks import applied, around_vertices, placed
from train.loop_masks import loop_mask
from train.models.from_recipe import general_rule, initial_networks
from train.models.recipes import general, general_quad
from train.models.torch_model import recipe_model
from train.refining import refine

SHAPES = {"torus": torus(7, 5), "globe": globe(9, 4), "box": box(1, 2, 3)}


@pytest.fixture(scope="module")
def no_solids():
    """The stream of pairs without solids, which take a second each to make, and patches."""
    slow = {stream.patch_pair: 0.0}
    shares = {make: 1 / (len(stream.SHARES) - 1) for make in stream.SHARES} | slow
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stream, "SHARES", shares)
        patch.setattr(stream, "SHARED", {})
        yield


@pytest.fixture(scope="module")
def batch(no_solids):
    small = (pair for pair in stream.pair_stream(0) if len(pair.coarse.faces) < 400)
    return limit_batch(list(islice(small, 5)), general(), np.random.default_rng(0))


def bold_networks(recipe):
    """Networks of double precision whose answers are large."""
    networks = initial_networks(recipe).double()
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for network in networks.children():
            last = network.linear_layers[-1]
            weight = torch.randn(last.weight.shape, generator=generator).double()
            last.weight = torch.nn.Parameter(weight) if network is networks.sharp else weight
    return networks


def open_grid():
    return grid_pair(np.random.default_rng(4)).coarse


def trained_and_product(mesh, recipe):
    """Sharpness and vertices after one level as they are trained, and the networks."""
    networks = bold_networks(recipe)
    made = learned_level([mesh], recipe)
    with torch.no_grad():
        sharp = made.sharpness(made.logits(networks.sharp))
        first = made.first(sharp, networks)
        second = made.second(sharp, first)
    assert 0.05 < sharp.edge[made.interior].max() < 1
    scheme = pns(recipe_model(recipe, *networks.children()))
    product = refine(mesh, scheme, 2, 1.0).mesh.vertices
    np.testing.assert_allclose(second, product, atol=1e-12)
    return recipe, networks, sharp, first


@pytest.mark.parametrize("body", polygon_bodies(0).shaped, ids=lambda body: body.name)
def test_both_levels_that_are_trained_on_polygons_are_the_products(body):
    trained_and_product(body.mesh, general_quad())


@pytest.mark.parametrize("mesh", [*SHAPES.values(), open_grid()], ids=[*SHAPES, "grid"])
def test_both_levels_that_are_trained_are_the_formulas_and_the_products(mesh):
    recipe, networks, sharp, first = trained_and_product(mesh, general())
    level = replace(connect(mesh.faces, len(mesh.vertices)), sharpness=sharp.edge)
    rule = general_rule(recipe, networks.edge, networks.vertex)
    expected = rule(torch.tensor(mesh.vertices), level).points.detach()
    torch.testing.assert_close(first, expected, rtol=0, atol=1e-12)


def test_masks_have_gradients_in_sharpness():
    mesh = SHAPES["box"]
    level, points = connect(mesh.faces, len(mesh.vertices)), torch.tensor(mesh.vertices)
    smooth = loop_mask(level).matrix()

    def at(w):
        return placed(smooth, around_vertices(level.edges, w, len(points)), level.edges, points)

    w = torch.rand(len(level.edges), generator=torch.Generator().manual_seed(1)).double()
    assert torch.autograd.gradcheck(at, w.requires_grad_())
    torch.testing.assert_close(at(w), loop_mask(replace(level, sharpness=w))(points))


def test_applied_has_the_transposed_gradient():
    mesh = SHAPES["torus"]
    matrix = loop_mask(connect(mesh.faces, len(mesh.vertices))).matrix()
    points = torch.from_numpy(mesh.vertices.copy()).requires_grad_()
    weights = torch.rand(matrix.shape[0], 3, dtype=torch.float64)
    (weights * applied(matrix, points)).sum().backward()
    np.testing.assert_allclose(points.grad, matrix.toarray().T @ weights.numpy(), atol=1e-14)


def test_loop_against_itself_is_one_in_every_term(batch):
    weights = replace(general().training.weights, worse=0.0)
    expected = sum(getattr(weights, name) for name in ("mean", "spread", "peak", "normal"))
    loops = reference_of(batch)
    assert limit_loss(weights, loops, loops).item() == pytest.approx(expected)


def test_the_limit_of_loop_on_a_sphere_is_measured_as_it_is():
    mesh, dense = icosphere(1), icosphere(6)
    pair = Pair("sphere", mesh, Reference(dense.vertices, dense.vertices.copy()))
    one = limit_batch([pair], general(), np.random.default_rng(0))
    limit = refine(mesh, loop(), 2, limit=True).mesh
    corners = limit.vertices[limit.faces]
    away = 1 - np.linalg.norm(corners.mean(axis=1), axis=1)
    measures = reference_of(one)
    assert measures.mean.item() == pytest.approx(away.mean(), rel=0.05)
    assert measures.mean.item() < measures.peak.item() < away.max()
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    outwards = corners.mean(axis=1) / np.linalg.norm(corners.mean(axis=1), axis=1, keepdims=True)
    expected = np.linalg.norm(across - outwards, axis=1).mean()
    assert measures.normal.item() == pytest.approx(expected, rel=0.15)


def test_the_limit_of_polygons_is_the_librarys():
    for body in polygon_bodies(0).shaped:
        made = pns_common.refine(body.mesh, catmull_clark(), 2, limit=False)
        mesh, limit = made.mesh, pns_common.refine(body.mesh, catmull_clark(), 2, limit=True).mesh
        placed = limit_matrix(mesh.topology(), CATMULL_CLARK) @ mesh.vertices
        np.testing.assert_allclose(placed, limit.vertices, atol=1e-12)


def test_measures_see_a_shift(batch):
    with torch.no_grad():
        smooth = batch.level.smooth_sharpness()
        points = batch.level.second(smooth, batch.level.first(smooth, None))
        here = measure(batch, points).mean
        away = torch.stack([measure(batch, points + shift).mean for shift in 0.3 * torch.eye(3)])
    assert (away.amax(dim=0) > here + 0.02).all()


def test_batches_made_ahead_are_those_made_here(no_solids, monkeypatch):
    base = general()
    plan = msgspec.structs.replace(base.training, faces=200, pool=2, reuse=2)
    recipe = replace(base, steps=7, training=plan)
    # A process would draw from the stream as it is, not from this one.
    monkeypatch.setattr(limit_trainer, "ahead", lambda make, *arguments: make(*arguments))
    drawn = list(limit_trainer._draws(recipe, plan))
    assert [len(draw.places) for draw in drawn] == [2, 2, 2, 1]
    given = [batch for batch, _ in limit_trainer.batches(recipe, plan)]
    kept = [[0], [0, 1], [1, 2], [2, 3]]
    expected = [drawn[kept[n][place]] for n, draw in enumerate(drawn) for place in draw.places]
    for batch, draw in zip(given, expected, strict=True):
        assert torch.equal(batch.level.points, draw.batch.level.points)
    # A batch that has travelled has the measures that it had.
    travelled = pickle.loads(pickle.dumps(drawn[0]))
    measured = reference_of(travelled.batch)
    for name in ("mean", "normal", "peak"):
        assert torch.equal(getattr(measured, name), getattr(drawn[0].reference, name))


def test_a_few_steps_over_catmull_clark_lower_the_loss_and_leave_sharpness_as_it_is():
    base = general_quad()
    plan = msgspec.structs.replace(base.training, faces=100, pool=1, reuse=1000)
    recipe = replace(base, steps=12, training=plan, learning_rate=1e-2)
    networks, losses = fit_to_limit(recipe, plan, lambda *_: None)
    assert losses[-1] < losses[0] - 0.02
    for own, before in zip(
        networks.sharp.parameters(), initial_networks(recipe).sharp.parameters(), strict=True
    ):
        assert torch.equal(own, before)


def test_a_few_steps_lower_the_loss_and_are_the_same_again(no_solids):
    base = general()
    plan = msgspec.structs.replace(base.training, faces=200, pool=1, reuse=1000, start=4)
    recipe = replace(base, steps=16, training=plan, learning_rate=1e-2)
    first, second = (fit_to_limit(recipe, plan, lambda *_: None) for _ in range(2))
    losses = first[1]
    assert losses[3] < losses[0]
    assert losses[-1] < losses[4] - 0.02
    assert first[1] == second[1]
    for weight, again in zip(first[0].parameters(), second[0].parameters(), strict=True):
        assert torch.equal(weight, again)
