"""The edge operator: what its edges see, and the same correction by all of its parts."""

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import paper_features
from pns_common.features.orientation import FIRST_FACE, SYMMETRIC
from pns_common.formula.correction import by_curvature, curvature_gate
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.geometry.frames import face_normals
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh, shortened

POINTS, FACES = bumpy_sphere(8, subdivisions=0, bump=0.2)
TOPOLOGY, PLAIN = build_topology(FACES, len(POINTS)), PlainMesh(POINTS, FACES)
ROWS = np.array([4, 0, 17])
NORMALS = face_normals(POINTS, FACES)


def operator(orientation=SYMMETRIC):
    return EdgeOperator(
        paper_features, orientation, lambda rows: 0.1 * rows[:, :3], curvature_gate(2.0)
    )


def test_edges_see_their_points_normals_and_the_data_of_their_vertices():
    fields = np.arange(2.0 * len(POINTS)).reshape(-1, 2)
    seen = operator().stencil(POINTS, NORMALS, fields, TOPOLOGY, ROWS)
    for row, (a, b) in enumerate(TOPOLOGY.edges[ROWS].tolist()):
        c, d = PLAIN.across[a, b], PLAIN.across[b, a]
        corners = np.stack([seen.a[row], seen.b[row], seen.c[row], seen.d[row]])
        np.testing.assert_array_equal(corners, POINTS[[a, b, c, d]])
        np.testing.assert_array_equal(seen.fields[row], fields[[a, b, c, d]])
        np.testing.assert_allclose([seen.n1[row], seen.n2[row]], PLAIN.normals(a, b), atol=1e-14)


def test_its_orientation_says_which_side_is_c():
    sides = operator(FIRST_FACE).stencil(POINTS, NORMALS, None, TOPOLOGY, ROWS)
    np.testing.assert_array_equal(sides.c, POINTS[TOPOLOGY.stencil[ROWS, 2]])


def expected(prior, asked, gate_sharpness):
    """γ Π(prior + asked F z) by the plain formula, with ρ = h² / 5."""
    rows = []
    for row, (a, b) in enumerate(TOPOLOGY.edges[ROWS].tolist()):
        z = shortened(0.1 * np.array(PLAIN.edge_features(a, b)[:3]), 1)
        wanted = prior[row] + asked[row] * np.transpose(PLAIN.frame(a, b)) @ z
        gate = np.tanh(gate_sharpness * PLAIN.jump(a, b) ** 2)
        rows.append(gate * shortened(wanted, PLAIN.length(a, b, None) ** 2 / 5))
    return rows


def test_corrections_are_the_formula_of_all_its_parts():
    seen = operator().stencil(POINTS, NORMALS, None, TOPOLOGY, ROWS)
    square = np.array([PLAIN.length(a, b, None) ** 2 for a, b in TOPOLOGY.edges[ROWS].tolist()])
    made = operator().correct(seen, 1 / 5)
    np.testing.assert_allclose(
        made.displacement, expected(np.zeros((3, 3)), square / 5, 2.0), atol=1e-15
    )
    prior, asked = 0.02 * POINTS[:3], np.array([0.3, 0.1, 2.0])
    other = by_curvature(curvature_gate(0.5))
    made = operator().correct_scale_free(seen, 1 / 5, asked, prior, other, wide_bound=False)
    np.testing.assert_allclose(made.displacement, expected(prior, asked, 0.5), atol=1e-15)
    wide = operator().correct_scale_free(seen, 1 / 5, asked, prior, other, wide_bound=True)
    sides = [PLAIN.longest_side(a, b) for a, b in TOPOLOGY.edges[ROWS].tolist()]
    np.testing.assert_allclose(wide.envelope, np.square(sides) / 5)
