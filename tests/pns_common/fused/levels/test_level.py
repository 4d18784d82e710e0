"""A level of the kernels has the connectivity of the array kernels, level after level."""

import weakref
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ParameterError
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES, Creases, crease_children, with_creases
from pns_common.connectivity.topology import Topology, build_topology, split
from pns_common.fused.levels.level import ROUNDING, control_level, loop_step, next_level
from pns_common.levels.refined_levels import check_coordinates
from pns_common.mesh import LARGEST_COORDINATE
from tests.support.kernels import by_arrays, by_kernels, edges_of
from tests.support.meshes import TETRAHEDRON, bent, grid, manifolds, soups

SEEDS = st.integers(0, 2**32 - 1)


def assert_same_topology(compiled, expected):
    for field in fields(Topology):
        ours, theirs = (getattr(each, field.name) for each in (compiled, expected))
        assert np.array_equal(ours, theirs), field.name


@given(soups() | manifolds(), SEEDS)
def test_a_levels_topology_is_the_array_kernels(mesh, seed):
    creases = edges_of(mesh, 3, seed)
    level = control_level(mesh.vertices, mesh.faces, Creases(creases), Blocks(1))
    expected = with_creases(build_topology(mesh.faces, len(mesh.vertices)), creases)
    assert_same_topology(level.topology(), expected)
    below = next_level(level, np.zeros((len(mesh.vertices) + len(expected.edges), 3)), Blocks(1))
    after = build_topology(split(expected), expected.vertex_count + len(expected.edges))
    assert_same_topology(below.topology(), with_creases(after, crease_children(expected)))


def test_a_crease_that_is_no_edge_is_refused():
    mesh = Mesh(np.random.default_rng(0).standard_normal((5, 3)), TETRAHEDRON)
    with pytest.raises(ParameterError, match="creases"):
        by_kernels(mesh, 1, creases=np.array([[0, 4]]))


def test_a_step_of_loop_adds_nothing_and_reports_what_the_arrays_do():
    mesh = Mesh(*grid(4, bent))
    step = loop_step(control_level(mesh.vertices, mesh.faces, NO_CREASES, Blocks(1)), Blocks(1))
    arrays = by_arrays(mesh, 1)
    assert step.added is None
    np.testing.assert_array_equal(step.points, arrays.points)
    assert [step.report()] == arrays.reports


def test_loop_lets_go_of_what_crease_lines_asked_of_faces():
    points, faces = grid(4, bent)
    level = control_level(points, faces, Creases(line_angle=60.0), Blocks(1))
    normals = weakref.ref(level.faces.normals)
    loop_step(level, Blocks(1))
    assert normals() is None


def test_how_large_loops_points_are_is_told_from_those_they_are_made_of():
    points, faces = grid(4, bent)
    size = np.abs(points).max()
    for scale in (1.0, LARGEST_COORDINATE / size):
        level = control_level(scale * points, faces, NO_CREASES, Blocks(1))
        step = loop_step(level, Blocks(1))
        assert np.abs(step.points).max() <= step.largest <= ROUNDING * scale * size
        # As exact as the limit asks.
        check_coordinates(step.largest)
