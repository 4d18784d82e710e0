"""The rule of curves beside the kernels: in any blocks it makes what it makes of whole levels."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import EdgeClass
from pns_common.formula.curve_prior import on_boundary
from pns_common.fused.learned.curves import NO_RULE, CurveLevel, curves_of, placed_pushes
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.loop_points import place_vertices
from pns_common.masks.stencils import loop_vertex_vertices
from pns_common.rules.control_level import control_level
from tests.support.creased import MESHES, creased
from tests.support.kernels import assert_same_bits, by_arrays, by_kernels, edges_built
from tests.support.meshes import bent, bumpy_sphere, grid, three_pages
from tests.support.networks import SCALE_FREE_CARD, scale_free_model
from tests.support.stand_in_models import Constant

RULE = pns(scale_free_model(0, boundary_strength=1.0)).edge_rule.curves
STRENGTHS = {"boundary_strength": 1.0, "crease_prior": True, "tip_strength": 0.7}
OF_CREASES = pns(scale_free_model(0, **STRENGTHS)).edge_rule.curves
OPEN = Mesh(*grid(5, bent))
IN_BLOCKS = Blocks(2, 5)


def with_boundary_rule(mesh):
    card = replace(SCALE_FREE_CARD, boundary_strength=1.0)
    scheme = pns(Constant(card, 0.3, 0.2))
    return by_arrays(mesh, 2, scheme=scheme), by_kernels(mesh, 2, scheme=scheme)


def test_a_boundary_rule_changes_nothing_where_there_is_no_boundary():
    assert_same_bits(*with_boundary_rule(Mesh(*bumpy_sphere(1))))


def test_a_boundary_rule_has_the_same_bits_where_there_is_one():
    sphere = Mesh(*bumpy_sphere(1))
    assert_same_bits(*with_boundary_rule(Mesh(sphere.vertices, sphere.faces[2:])))


def test_a_vertex_where_three_pages_meet_is_on_no_curve():
    points, faces = three_pages()
    edges = edges_built(Mesh(points, faces))
    of_curve = edges.edge_class == EdgeClass.BOUNDARY
    level = CurveLevel.of(points, edges, 1.0, of_curve, Blocks(1))
    assert level.rows.tolist() == [2, 3, 4]
    assert np.sort(level.sides[level.rows]).tolist() == 3 * [[0, 1]]


@pytest.mark.parametrize("blocks", [Blocks(1), IN_BLOCKS], ids=["whole", "in blocks"])
@pytest.mark.parametrize("own_lengths", [False, True])
@given(mesh=MESHES, seed=st.integers(0, 99))
def test_what_it_adds_is_what_the_rule_adds(blocks, own_lengths, mesh, seed):
    topology, edges = creased(mesh, seed)
    count, edge_count = len(mesh.vertices), len(topology.edges)
    length = np.random.default_rng(seed).uniform(0.5, 2, count) if own_lengths else 0.7
    level = replace(control_level(mesh.vertices, topology), reference_length=length)
    curves, loop = level.curves(OF_CREASES.kinds), loop_vertex_vertices(mesh.vertices, topology)
    moves = curves_of(OF_CREASES, mesh.vertices, edges, length, blocks)
    vertices, of_edges = Additions.unwritten(count), Additions.unwritten(edge_count)
    vertices = replace(vertices, corrected=np.zeros(count, dtype=bool))
    for added in (vertices, of_edges):
        added.clear()
    moves.move_vertices(loop, vertices)
    moves.move_edges(of_edges)
    np.testing.assert_array_equal(vertices.corrected, curves.movable)
    made = OF_CREASES.at_vertices(level, loop[curves.rows]), OF_CREASES.at_edges(level)
    for added, rows, of in zip(
        (vertices, of_edges), (curves.rows, curves.edges), made, strict=True
    ):
        expected = np.zeros_like(added.displacement)
        expected[rows] = of.displacement
        np.testing.assert_array_equal(added.displacement, expected)
        np.testing.assert_array_equal(added.envelope[rows], of.envelope)
        assert not added.gate.any()


@pytest.mark.parametrize("blocks", [Blocks(1), IN_BLOCKS], ids=["whole", "in blocks"])
@given(mesh=MESHES, seed=st.integers(0, 99))
def test_beside_curves_loops_mask_of_pushes_is_that_of_the_whole(blocks, mesh, seed):
    topology, edges = creased(mesh, seed)
    moves = curves_of(OF_CREASES, mesh.vertices, edges, 1.0, blocks)
    placed = placed_pushes(moves, edges, topology.valence.astype(np.int32), blocks)
    smooth = np.bincount(edges.edges[edges.sharp_edges].reshape(-1), minlength=len(mesh.vertices))
    if len(moves.pushes):
        whole = np.empty_like(moves.pushes)
        place_vertices(moves.pushes, edges, blocks, whole)
        assert placed[smooth == 0].tobytes() == whole[smooth == 0].tobytes()
    else:
        assert len(placed) == 0


@given(mesh=MESHES, seed=st.integers(0, 99))
def test_what_pieces_share_is_what_boundaries_alone_place(mesh, seed):
    topology, edges = creased(mesh, seed)
    shared, expected = None, on_boundary(topology)
    for rule in (RULE, OF_CREASES):
        shared = curves_of(rule, mesh.vertices, edges, 1.0, IN_BLOCKS).shared()
        if expected.any():
            np.testing.assert_array_equal(shared, expected)
        else:
            assert shared is None


def test_where_there_is_no_rule_or_no_boundary_nothing_is_shared():
    closed = Mesh(*bumpy_sphere(0, subdivisions=0))
    without = curves_of(RULE, closed.vertices, edges_built(closed), 1.0, Blocks(1))
    assert (without.level, without.shared(), str(without.nothing)) == (None, None, "0.0")
    assert curves_of(None, OPEN.vertices, edges_built(OPEN), 1.0, Blocks(1)) is NO_RULE
    assert NO_RULE.shared() is None
    assert str(NO_RULE.nothing) == "-0.0"  # which leaves a -0 as it is
