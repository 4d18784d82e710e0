"""Lines by kernels are those of the formulas, however the work is divided."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.levels.crease_lines import crease_line_rows
from pns_common.fused.levels.face_measures import face_normals
from pns_common.geometry.crease_lines import line_rows
from pns_common.geometry.frames import face_normals as array_normals
from tests.support.crease_lines import pleat, tube
from tests.support.kernels import edges_built
from tests.support.meshes import block, manifolds, soups


def found_by_kernels(mesh, creases, blocks):
    normals = face_normals(mesh.vertices, mesh.faces.astype(np.int32), blocks)
    return crease_line_rows(mesh.vertices, edges_built(mesh), normals, creases, blocks)


def expected_lines(mesh, creases):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    return line_rows(mesh.vertices, array_normals(mesh.vertices, mesh.faces), topology, creases)


@given(
    manifolds() | soups(),
    st.floats(1, 170),
    st.floats(0.01, 0.99) | st.none(),
    st.sampled_from([None, True, False]),
    st.integers(1, 3),
)
def test_kernels_find_the_lines_of_the_formulas(mesh, angle, share, edged, threads):
    gentle = None if share is None else share * angle
    creases = Creases(line_angle=angle, edged_angle=gentle, edged=edged)
    found = found_by_kernels(mesh, creases, Blocks(threads, 5))
    np.testing.assert_array_equal(found, expected_lines(mesh, creases))


@pytest.mark.parametrize("closed", [True, False])
def test_they_find_those_of_a_noisy_block(closed):
    mesh = Mesh(*block(4, noise=0.03, closed=closed))
    creases = Creases(line_angle=66.0, edged_angle=20.0)
    found = found_by_kernels(mesh, creases, Blocks(2, 7))
    np.testing.assert_array_equal(found, expected_lines(mesh, creases))
    assert len(found) > 20


@pytest.mark.parametrize("edged", [None, True, False])
@pytest.mark.parametrize("mesh", [pleat(30), tube(8, across=3), tube(8, across=1)])
def test_they_find_those_beside_plane_sides(mesh, edged):
    creases = Creases(line_angle=66.0, edged_angle=21.0, edged=edged)
    found = found_by_kernels(mesh, creases, Blocks(2, 7))
    np.testing.assert_array_equal(found, expected_lines(mesh, creases))
