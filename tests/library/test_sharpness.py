"""Learned sharpness: weights within their gates, the same whatever is marked beside them."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Creases, Mesh, load_model, pns, sharp_edges
from pns_common.operator.level import Level
from pns_common.operator.sharpness import creases_by_name, shares_of_corners, shares_of_edges
from pns_common.parallel import Blocks
from pns_common.schemes import LOOP
from tests.support.control_points import refine
from tests.support.meshes import bumpy_sphere, every_edge_class, prism, tilted_plane
from tests.support.networks import default_model
from tests.support.polygons import CUBE, CUBE_FACES

SCHEME = pns(default_model(8, 1.0))
RULE = SCHEME.rule


def level_of(mesh, threads=1):
    return Level(mesh.vertices, mesh.topology(), LOOP, None, Blocks(threads))


@pytest.mark.parametrize("name", every_edge_class())
def test_sharpness_is_within_its_gate_and_0_at_open_edges(name):
    level = level_of(Mesh(*every_edge_class()[name]))
    w, corners = shares_of_edges(level, RULE), shares_of_corners(level, RULE)
    interior = np.zeros(len(w), dtype=bool)
    interior[level.topology.interior] = True
    assert (w[~interior] == 0).all()
    assert (w <= np.tanh(RULE.vertex_gate_sharpness * level.unmarked.edges.jumps)).all()
    for shares in (w, corners):
        assert ((shares >= 0) & (shares <= 1)).all()


@pytest.mark.parametrize("seed", range(5))
def test_planes_have_no_sharpness(seed):
    level = level_of(tilted_plane(seed))
    assert shares_of_edges(level, RULE).max() == 0
    inside = level.topology.sharp_count == 0
    assert shares_of_corners(level, RULE)[inside].max() == 0


def test_marks_do_not_change_what_is_learned():
    level = level_of(Mesh(*bumpy_sphere()))
    marked = level.topology.with_creases(np.arange(0, 60, 3))
    same = Level(level.points, marked, LOOP, None, Blocks())
    for shares in (shares_of_edges, shares_of_corners):
        np.testing.assert_array_equal(shares(same, RULE), shares(level, RULE))


def test_hubs_cost_no_square_of_their_valence():
    turns = np.linspace(0, 2 * np.pi, 20_001)[:-1]
    mesh = prism(np.stack([np.cos(turns), np.sin(turns)], axis=1))
    assert np.isfinite(shares_of_edges(level_of(mesh), RULE)).all()  # hours otherwise


def test_automatic_creases_are_those_of_the_network():
    """As sharp as it says, for the levels on the card, beside what is named; and by name alike."""
    mesh = Mesh(*bumpy_sphere())
    made = refine(mesh, SCHEME, 3)
    w = shares_of_edges(level_of(mesh), RULE)
    first, second, third = made.topologies
    np.testing.assert_array_equal(first.soft, w)
    np.testing.assert_array_equal(np.sort(second.soft)[-2 * len(w) :], np.sort(np.repeat(w, 2)))
    assert len(third.soft) == 0
    counts = [level["edges"].get("soft", 0) for level in made.report["levels"]]
    assert counts == [(w > 1 / 2).sum(), 2 * (w > 1 / 2).sum(), 0]
    assert counts[0] > 0
    named = creases_by_name(mesh, SCHEME.creases, SCHEME)
    again = refine(mesh, SCHEME, 3, creases=named)
    np.testing.assert_array_equal(again.mesh.vertices, made.mesh.vertices)
    marked = refine(mesh, SCHEME, 1, creases=named.with_named(first.edges[:3].astype(int)))
    assert marked.report["levels"][0]["edges"]["crease"] == 3
    expected = first.edges[w > 1 / 2]
    found = sharp_edges(mesh, scheme=SCHEME)
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, expected.tolist()))


def test_marks_that_wear_off_leave_what_the_networks_find():
    mesh, scheme = Mesh(CUBE, CUBE_FACES).triangulated(), pns(load_model())
    marked = Creases(mesh.topology().edges[:1].astype(np.int64), np.array([0.25]), wears=True)
    both = replace(marked, learned=True, levels=scheme.creases.levels)
    for levels in 1, 3:
        found, beside, alone = (
            refine(mesh, scheme, levels, creases=each).mesh.vertices
            for each in ("auto", both, marked)
        )
        np.testing.assert_allclose(beside, found, atol=0.01)
        assert np.abs(beside - alone).max() > 0.1
