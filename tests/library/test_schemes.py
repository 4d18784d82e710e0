"""Schemes: a base scheme is a few lines, and a card's numbers reach the rule."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from pns_common import (
    Mesh,
    MeshError,
    ModelError,
    Scheme,
    catmull_clark,
    load_model,
    loop,
    pns,
    refine,
)
from pns_common.mesh.topology import split_triangles
from pns_common.model.file import bundled_models
from pns_common.schemes.base_scheme import BaseScheme
from tests.support.meshes import bumpy_sphere, grid
from tests.support.networks import Float64Model, default_model, random_layers
from tests.support.polygons import mixed_cube
from train.spectra import stars


def midpoints(values, topology, blocks):
    """Keep old vertices, and put new ones into the middle of edges: the masks of a toy scheme."""
    ends = topology.edges
    return np.concatenate([values, (values[ends[:, 0]] + values[ends[:, 1]]) / 2])


FLAT = Scheme("flat", BaseScheme("flat", midpoints, split_triangles))


@pytest.mark.parametrize("valence", range(3, 13))
def test_tangent_eigenvalues_of_a_star_are_the_published_ones(valence):
    """Loop's 3/8 + cos(2π/k)/4; λ of Halstead, Kass and DeRose. No other is as large, but for 1."""
    c = np.cos(2 * np.pi / valence)
    of_quads = (5 + c + np.cos(np.pi / valence) * np.sqrt(18 + 2 * c)) / 16
    for scheme, star, published in (
        (loop(), stars.star(valence, 3, 1.0), 3 / 8 + c / 4),
        (catmull_clark(), stars.quad_star(valence, 3, 1.0), of_quads),
    ):
        matrix = scheme.matrix(star.mesh).toarray()[np.ix_(star.refined, star.inner)]
        values = np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]
        np.testing.assert_allclose(values[:3], [1, published, published], rtol=0, atol=1e-12)
        assert values[3] < published - 1e-3


def test_a_new_base_scheme_is_a_few_lines():
    mesh = Mesh(*bumpy_sphere())
    refined = refine(mesh, FLAT, 3)
    assert refined.report["scheme"] == "flat"
    assert len(refined.mesh.faces) == 64 * len(mesh.faces)
    np.testing.assert_array_equal(refined.mesh.vertices[: len(mesh.vertices)], mesh.vertices)
    corners = refined.mesh.vertices[refined.mesh.faces]
    area = np.linalg.norm(np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2))), axis=1).sum()
    given = mesh.vertices[mesh.faces]
    before = np.linalg.norm(np.cross(*(given[:, k] - given[:, 0] for k in (1, 2))), axis=1).sum()
    assert area == pytest.approx(before)


def test_each_number_of_a_card_reaches_its_place_in_the_rule():
    numbers = {
        "gate_sharpness": 3.0,
        "vertex_gate_sharpness": 5.0,
        "boundary_strength": 0.6,
        "network_scale": 0.3,
        "fold_angle": 60.0,
    }
    scheme = pns(default_model(0, **numbers, sharpness_levels=3), 4)
    rule = scheme.rule
    named = {name: getattr(rule, name) for name in numbers if name != "boundary_strength"}
    assert named | {"boundary_strength": rule.curve_strength} == numbers
    assert (rule.budget, rule.networks.width, len(rule.networks.rounds)) == (4.0, 8, 2)
    assert (scheme.learned_levels, scheme.creases.levels) == (1, 3)


def test_the_papers_model_acts_at_every_level_and_the_default_once():
    scheme = pns(Float64Model(random_layers(0)))
    assert scheme.acts_at(15)
    once = pns(default_model())
    assert [once.acts_at(level) for level in range(3)] == [True, False, False]
    assert not loop().acts_at(0)


def test_networks_are_asked_at_a_budget_of_one():
    """Their answers are scaled afterwards in float64, so one file serves every C / R."""
    asked = []

    class Asked(Float64Model):
        def run(self, given, rows, budget=1.0):
            asked.append(budget)
            return np.zeros((len(rows), 3))

    refine(Mesh(*bumpy_sphere()), pns(Asked(random_layers(0)), 7.0), 1)
    assert set(asked) == {1.0}


def test_a_base_scheme_that_is_not_known_is_refused():
    model = Float64Model(random_layers(0))
    model.card = replace(default_model().card, base="butterfly")
    with pytest.raises(ModelError, match="butterfly"):
        pns(model)


def test_the_default_model_takes_polygons_by_its_companion():
    """Triangles alone go to Loop and general; other faces to Catmull–Clark and general-quad."""
    scheme = pns(load_model())
    triangles = Mesh(*bumpy_sphere())
    assert refine(triangles, scheme, 1).report["model"] == "general"
    points, faces = mixed_cube()
    mesh = Mesh(points, faces)
    for given in (scheme, "pns"):
        made = refine(mesh, given, 2)
        assert made.report["model"] == "general-quad"
        expected = refine(mesh, pns(load_model("general-quad")), 2).mesh.vertices
        np.testing.assert_array_equal(made.mesh.vertices, expected)
    assert refine(mesh, pns(load_model(), 0.5), 1).report["budget"] == 0.5
    with pytest.raises(MeshError, match="catmull-clark"):
        refine(mesh, pns(load_model("signed")), 1)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_scheme_can_be_sent_to_another_process(again):
    mesh = Mesh(*grid(4, lambda x, y: x * y))
    for scheme in (loop(), *(pns(load_model(name)) for name in bundled_models(companions=True))):
        ours, theirs = (refine(mesh, each, 2) for each in (scheme, again(scheme)))
        np.testing.assert_array_equal(theirs.mesh.vertices, ours.mesh.vertices)
        assert theirs.report == ours.report
