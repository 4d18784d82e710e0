"""Training to the limit: the linear maps, the measures, and that a few steps help."""

import pickle
from dataclasses import replace
from itertools import islice

import msgspec
import numpy as np
import pytest
import torch

from pns_common import loop, pns
from train.connectivity import connect
from train.data.pairs import pair_stream as stream
from train.data.pairs.grid import grid_pair
from train.data.pairs.references import AUTHORED, Pair, Reference
from train.data.primitives import box, globe, icosphere, torus
from train.fitting import limit_trainer
from train.fitting.learned_level import learned_level
from train.fitting.limit_batch import SMOOTH_KINDS, limit_batch
from train.fitting.limit_loss import Standards, limit_loss, measure
from train.fitting.limit_maps import applied, limit_maps
from train.fitting.limit_trainer import fit_to_limit, limit_measures, standards_of
from train.loop_masks import loop_mask
from train.metrics.shape import bending, vertex_normals
from train.models.from_recipe import general_rule, initial_network, initial_vertex_network
from train.models.recipes import general
from train.models.torch_model import recipe_model
from train.refining import refine

SHAPES = {"torus": torus(7, 5), "globe": globe(9, 4), "box": box(1, 2, 3)}
SURFACE = Reference(SHAPES["torus"].vertices, vertex_normals(SHAPES["torus"]))


@pytest.fixture(scope="module")
def no_solids():
    """The stream of pairs without curved solids, which take a second each to make, and patches."""
    shares = [0.0, 0.3, 0.3, 0.2, 0.1, 0.1, 0.0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stream, "SHARES", dict(zip(stream.SHARES, shares, strict=True)))
        yield


@pytest.fixture(scope="module")
def batch(no_solids):
    small = (pair for pair in stream.pair_stream(0) if len(pair.coarse.faces) < 400)
    return limit_batch(list(islice(small, 5)), general(), np.random.default_rng(0))


def open_grid():
    return grid_pair(np.random.default_rng(4)).coarse


@pytest.mark.parametrize("mesh", [*SHAPES.values(), open_grid()], ids=[*SHAPES, "grid"])
def test_the_step_that_is_trained_is_the_formulas_and_the_products(mesh):
    recipe = general()
    networks = [initial_network(recipe).double(), initial_vertex_network(recipe).double()]
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for network in networks:
            last = network.linear_layers[-1]
            last.weight = torch.randn(last.weight.shape, generator=generator).double()
    made = learned_level(mesh, recipe).points(*networks).detach()
    level = connect(mesh.faces, len(mesh.vertices))
    expected = general_rule(recipe, *networks)(torch.tensor(mesh.vertices), level).points.detach()
    torch.testing.assert_close(made, expected, rtol=0, atol=1e-12)
    # In use the prior is weaker.
    weaker = replace(recipe.scale_free, prior_strength=recipe.training.trained_strength)
    scheme = pns(recipe_model(replace(recipe, scale_free=weaker), *networks))
    product = refine(mesh, scheme, 1, 1.0, creases=None).mesh.vertices
    np.testing.assert_allclose(made, product, atol=1e-12)


@pytest.mark.parametrize("levels", [0, 1])
@pytest.mark.parametrize("mesh", [*SHAPES.values(), open_grid()], ids=[*SHAPES, "grid"])
def test_maps_lead_to_where_many_levels_lead(mesh, levels):
    maps = limit_maps(connect(mesh.faces, len(mesh.vertices)), levels)
    deep = refine(mesh, loop(), 5).mesh
    count = len(maps.ancestor)
    positions = maps.position @ mesh.vertices
    np.testing.assert_allclose(positions, deep.vertices[:count], atol=1e-3 * np.ptp(mesh.vertices))
    across = np.cross(maps.tangent @ mesh.vertices, maps.cotangent @ mesh.vertices)
    across = across[maps.smooth] / np.linalg.norm(across[maps.smooth], axis=1, keepdims=True)
    a, b, c = (deep.vertices[deep.faces[:, corner]] for corner in range(3))
    normals = np.zeros_like(deep.vertices)
    np.add.at(normals, deep.faces.reshape(-1), np.repeat(np.cross(b - a, c - a), 3, axis=0))
    expected = normals[:count][maps.smooth]
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert (across * expected).sum(axis=1).min() > 0.99


def test_applied_has_the_transposed_gradient():
    mesh = SHAPES["torus"]
    matrix = loop_mask(connect(mesh.faces, len(mesh.vertices))).matrix()
    points = torch.from_numpy(mesh.vertices.copy()).requires_grad_()
    weights = torch.rand(matrix.shape[0], 3, dtype=torch.float64)
    (weights * applied(matrix, points)).sum().backward()
    np.testing.assert_allclose(points.grad, matrix.toarray().T @ weights.numpy(), atol=1e-14)


@pytest.fixture(scope="module")
def held(batch):
    return standards_of(batch)


def test_loop_against_itself_is_one_in_every_term(batch, held):
    weights = general().training.weights
    terms = ("mean", "spread", "peak", "normal", "normal_spread")
    expected = sum(getattr(weights, name) for name in terms)
    even = replace(weights, worse=0.0)
    same = Standards(loop=held.loop, prior=held.loop)
    assert limit_loss(even, kinds_of(batch), held.loop, same).item() == pytest.approx(expected)


@pytest.mark.parametrize("kind", ["sharp", "smooth", "authored"])
def test_bending_too_much_costs_by_the_kind_of_mesh(kind, batch, held):
    weights = replace(general().training.weights, jump=0.0)
    same = Standards(loop=held.loop, prior=held.loop)
    kinds = kinds_of(batch, kind)
    more = replace(held.loop, bend=4 * held.loop.bend)
    costs = [limit_loss(weights, kinds, measures, same).item() for measures in (held.loop, more)]
    allowed = getattr(weights, f"{kind}_bend")
    weight = weights.sharp if kind == "sharp" else weights.ripples
    expected = weights.bend * np.log(4) + weight * np.log(4 / allowed)
    assert costs[1] - costs[0] == pytest.approx(expected, rel=1e-2)


def test_what_is_to_bend_no_more_than_the_prior_is_counted_as_smooth():
    pairs = [Pair(kind, SHAPES["torus"], SURFACE) for kind in (*SMOOTH_KINDS, "faceted", AUTHORED)]
    batch = limit_batch(pairs, general(), np.random.default_rng(0))
    assert batch.smooth.tolist() == [True] * len(SMOOTH_KINDS) + [False, False]
    assert batch.authored.tolist() == [False] * (len(SMOOTH_KINDS) + 1) + [True]


def test_of_authored_meshes_fairness_alone_is_asked(batch, held):
    weights, authored = general().training.weights, kinds_of(batch, "authored")
    worse = replace(held.loop, mean=9 * held.loop.mean, normal=9 * held.loop.normal)
    costs = [limit_loss(weights, authored, measures, held) for measures in (held.loop, worse)]
    assert torch.equal(*costs)
    costs = [limit_loss(weights, kinds_of(batch), one, held) for one in (held.loop, worse)]
    assert costs[1] > costs[0] + 1


def kinds_of(batch, kind="sharp"):
    """The batch with all its meshes of one kind."""
    every = torch.ones(batch.count, dtype=bool)
    return replace(
        batch,
        authored=every if kind == "authored" else ~every,
        smooth=every if kind == "smooth" else ~every,
    )


@pytest.mark.parametrize("mesh", [torus(9, 6), globe(11, 6), box(1, 2, 3)])
def test_bending_is_that_of_a_finely_refined_mesh(mesh):
    pair = Pair("", mesh, Reference(mesh.vertices, vertex_normals(mesh)))
    one = limit_batch([pair], general(), np.random.default_rng(0))
    points = one.level.base
    expected = bending(refine(mesh, loop(), 5).mesh)
    assert measure(one, points).bend.item() == pytest.approx(expected, rel=0.03)


def test_untrained_networks_leave_the_prior_where_a_surface_bends_gently():
    recipe, mesh = general(), icosphere(3)
    networks = initial_network(recipe), initial_vertex_network(recipe)
    pair = Pair("", mesh, Reference(mesh.vertices, vertex_normals(mesh)))
    one = limit_batch([pair], general(), np.random.default_rng(0))
    with torch.no_grad():
        measures = limit_measures(one, *networks)
    standards = standards_of(one)
    torch.testing.assert_close(measures.bend, standards.prior.bend, rtol=1e-3, atol=0)
    assert (measures.bend < standards.loop.bend).all()


def test_measures_see_a_shift(batch):
    with torch.no_grad():
        points = batch.level.base
        shift = torch.tensor([0.3, 0.2, 0.1])
        here, away = measure(batch, points), measure(batch, points + shift)
    assert (away.mean > here.mean + 0.02).all()
    torch.testing.assert_close(away.bend, here.bend)


def test_batches_made_ahead_are_those_made_here(no_solids, monkeypatch):
    base = general()
    plan = msgspec.structs.replace(base.training, faces=200, pool=2, reuse=2)
    recipe = replace(base, steps=7, training=plan)
    # A process would draw from the stream as it is, not from this one.
    monkeypatch.setattr(limit_trainer, "ahead", lambda make, *arguments: make(*arguments))
    drawn = list(limit_trainer._draws(recipe, plan))
    assert [len(draw.places) for draw in drawn] == [2, 2, 2, 1]
    given = [batch for batch, _ in limit_trainer._batches(recipe, plan)]
    kept = [[0], [0, 1], [1, 2], [2, 3]]
    expected = [drawn[kept[n][place]] for n, draw in enumerate(drawn) for place in draw.places]
    for batch, draw in zip(given, expected, strict=True):
        assert torch.equal(batch.level.base, draw.batch.level.base)
    # A batch that has travelled has the measures that it had.
    travelled = pickle.loads(pickle.dumps(drawn[0]))
    measured = standards_of(travelled.batch)
    for name in ("mean", "normal", "bend"):
        own = getattr(drawn[0].standards.loop, name)
        assert torch.equal(getattr(measured.loop, name), own)


def test_a_few_steps_lower_the_loss_and_are_the_same_again(no_solids):
    base = general()
    plan = msgspec.structs.replace(base.training, faces=200, pool=1, reuse=1000)
    recipe = replace(base, steps=12, training=plan, learning_rate=1e-2)
    first, second = (fit_to_limit(recipe, plan, lambda *_: None) for _ in range(2))
    assert first[2][-1] < first[2][0] - 0.02
    assert first[2] == second[2]
    for weight, again in zip(first[0].parameters(), second[0].parameters(), strict=True):
        assert torch.equal(weight, again)
