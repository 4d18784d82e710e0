"""The boundary's rule beside the kernels sees sharp edges alone, and makes the same of them."""

from dataclasses import replace

import numpy as np

from pns_common import Mesh, pns
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.formula.curve_prior import on_boundary
from pns_common.fused.curves import NO_RULE, SharpLevel, curves_of
from pns_common.rules.control_level import control_level
from tests.support.kernels import assert_same_bits, by_arrays, by_kernels, edges_built
from tests.support.meshes import bent, bumpy_sphere, grid, three_pages
from tests.support.networks import SCALE_FREE_CARD, scale_free_model
from tests.support.stand_in_models import Constant

RULE = pns(scale_free_model(0, boundary_strength=1.0)).edge_rule.curves
OPEN = Mesh(*grid(5, bent))


def with_boundary_rule(mesh):
    card = replace(SCALE_FREE_CARD, boundary_strength=1.0)
    scheme = pns(Constant(card, 0.3, 0.2))
    return by_arrays(mesh, 2, scheme=scheme), by_kernels(mesh, 2, scheme=scheme)


def test_a_boundary_rule_changes_nothing_where_there_is_no_boundary():
    assert_same_bits(*with_boundary_rule(Mesh(*bumpy_sphere(1))))


def test_a_boundary_rule_has_the_same_bits_where_there_is_one():
    sphere = Mesh(*bumpy_sphere(1))
    assert_same_bits(*with_boundary_rule(Mesh(sphere.vertices, sphere.faces[2:])))


def test_a_level_of_sharp_edges_alone_has_their_vertices_and_classes():
    points, faces = three_pages()
    sharp = SharpLevel.of(points, edges_built(Mesh(points, faces)), 1.0)
    assert sharp.vertices.tolist() == [0, 1, 2, 3, 4]
    topology = build_topology(faces, len(points))
    np.testing.assert_array_equal(sharp.vertices[sharp.level.topology.edges], topology.edges)
    np.testing.assert_array_equal(sharp.level.topology.edge_class, topology.edge_class)
    lengths = SharpLevel.of(points, edges_built(Mesh(points, faces)), np.arange(1.0, 6)).level
    assert lengths.reference_length.tolist() == [1, 2, 3, 4, 5]


def test_its_pushes_and_what_is_shared_are_the_whole_meshs():
    whole = control_level(OPEN.vertices, build_topology(OPEN.faces, 25))
    boundary = curves_of(RULE, OPEN.vertices, edges_built(OPEN), 1.0)
    np.testing.assert_array_equal(boundary.pushes, RULE.pushes(whole))
    edge_count = len(whole.topology.edges)
    np.testing.assert_array_equal(boundary.shared(25, edge_count), on_boundary(whole.topology))
    sharp = whole.topology.edge_class == EdgeClass.BOUNDARY
    np.testing.assert_array_equal(boundary.sharp.edges, np.flatnonzero(sharp))


def test_where_there_is_no_rule_or_no_boundary_nothing_is_shared():
    closed = Mesh(*bumpy_sphere(0, subdivisions=0))
    without = curves_of(RULE, closed.vertices, edges_built(closed), 1.0)
    assert (without.sharp, without.shared(12, 30), str(without.nothing)) == (None, None, "0.0")
    assert curves_of(None, OPEN.vertices, edges_built(OPEN), 1.0) is NO_RULE
    assert str(NO_RULE.nothing) == "-0.0"  # which leaves a -0 as it is
