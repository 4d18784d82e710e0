"""Columns at vertices, corners, faces and edges follow the mesh that carries them."""

import numpy as np
import pytest

from pns_common import Creases, Mesh, ParameterError, catmull_clark, loop
from pns_common import refine as refine_to_limit
from pns_common.carry import rules
from pns_common.carry.carried import Carried, Carrier, Column, refine_carried
from pns_common.carry.charts import refine_corners
from pns_common.schemes import CATMULL_CLARK, LOOP
from tests.support.control_points import refine
from tests.support.meshes import bumpy_sphere, grid
from tests.support.polygons import SHAPES, mixed_cube, quad_grid, uneven

SCHEMES = {"triangles": (bumpy_sphere(), loop()), "polygons": (mixed_cube(), catmull_clark())}


def carried(at, column, mesh, scheme, levels=1, **options):
    made = refine_to_limit(mesh, scheme, levels, **options)
    on_limit = options.get("limit", True)
    columns = Carried(**{at: {"it": column}})
    asked = columns, made.topologies, scheme.base
    return getattr(refine_carried(*asked, limit=on_limit), at)["it"].values, made.mesh


@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("levels", [1, 3])
def test_positions_carried_smoothly_are_the_positions(name, levels, limit):
    """At vertices, and at corners too, also at creases that end, corners and limits."""
    shape, scheme = SCHEMES[name]
    mesh = Mesh(*shape)
    edges = mesh.topology().edges[:5].astype(np.int64)
    corners = {"vertices": [5, 7], "vertex_sharpness": [np.inf, 1.5]}
    creases = Creases(edges, np.linspace(0.2, 1, 5), levels=2, **corners)
    for at, values in (("vertices", mesh.vertices), ("corners", mesh.vertices[mesh.corners])):
        asked = at, Column(values, rules.smooth), mesh, scheme, levels
        made, fine = carried(*asked, limit=limit, creases=creases)
        expected = fine.vertices if at == "vertices" else fine.vertices[fine.corners]
        np.testing.assert_array_equal(made, expected)


@pytest.mark.parametrize("rule", [rules.smooth, rules.linear, rules.nearest])
@pytest.mark.parametrize("name", SCHEMES)
def test_corners_without_seams_have_one_value_at_each_vertex(name, rule):
    """A file of such values keeps one a vertex, labels too."""
    shape, scheme = SCHEMES[name]
    mesh = Mesh(*shape)
    made = refine(mesh, scheme, 2)
    carrier = Carrier(made.topologies, scheme.base)
    values, points = carrier.at_points(
        Column(np.arange(len(mesh.vertices))[mesh.corners, None], rule)
    )
    at_vertices = carrier.at_vertices(Column(np.arange(len(mesh.vertices))[:, None], rule))
    assert len(values) == len(made.mesh.vertices)
    if rule in (rules.smooth, rules.linear):
        np.testing.assert_array_equal(values[points], at_vertices[made.mesh.corners])


@pytest.mark.parametrize("name", SCHEMES)
def test_linear_columns_are_those_of_the_split_without_masks(name):
    """The base scheme halves edges and takes means of polygons where all edges are sharp."""
    shape, scheme = SCHEMES[name]
    mesh = Mesh(*shape)
    edges = mesh.topology().edges.astype(np.int64)
    fixed = Creases(edges, vertices=np.arange(len(mesh.vertices)))
    fine = refine(mesh, scheme, 1, creases=fixed).mesh
    at_vertices, _ = carried("vertices", Column(mesh.vertices), mesh, scheme)
    at_corners, _ = carried("corners", Column(mesh.vertices[mesh.corners]), mesh, scheme)
    np.testing.assert_allclose(at_vertices, fine.vertices, atol=1e-15)
    np.testing.assert_allclose(at_corners, fine.vertices[fine.corners], atol=1e-15)


@pytest.mark.parametrize(
    ("kind", "a", "b", "half"),
    [
        (np.float32, 1, 2, 1.5),
        (np.float64, 1.7e308, 1.7e308, 1.7e308),
        (np.float16, 60000, 60000, 60000),
        (np.complex64, 1j, 3j, 2j),
        (np.uint8, 1, 4, 2),
        (np.uint8, 255, 255, 255),
    ],
)
def test_halfway_is_the_mean_in_the_type_that_was_given(kind, a, b, half):
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    values, _ = carried("vertices", Column(np.array([a, b, a], dtype=kind)), mesh, loop())
    assert values.dtype == kind
    assert values[3] == half


def test_bytes_are_rounded_once_however_many_levels():
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    given = np.array([[0, 255], [1, 0], [2, 7]], dtype=np.uint8)
    exact, _ = carried("vertices", Column(given.astype(float)), mesh, loop(), 3)
    rounded, _ = carried("vertices", Column(given), mesh, loop(), 3)
    np.testing.assert_array_equal(rounded, np.rint(exact))


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("rule", [rules.nearest, rules.vote])
def test_labels_are_never_mixed(name, rule):
    shape, scheme = SCHEMES[name]
    mesh = Mesh(*shape)
    labels = 10 * np.arange(len(mesh.vertices)) + 3
    at_vertices, _ = carried("vertices", Column(labels, rule), mesh, scheme, 2)
    np.testing.assert_array_equal(at_vertices[: len(labels)], labels)
    assert set(at_vertices) <= set(labels)
    # A corner's label is that of the corner of the control face that it lies nearest to.
    at_corners, fine = carried("corners", Column(np.arange(len(mesh.corners)), rule), mesh, scheme)
    old = fine.corners < len(labels)
    np.testing.assert_array_equal(mesh.corners[at_corners[old]], fine.corners[old])
    faces = np.repeat(np.arange(mesh.face_count), np.diff(mesh.offsets))
    at_faces, _ = carried("faces", Column(np.arange(mesh.face_count)), mesh, scheme)
    np.testing.assert_array_equal(faces[at_corners], np.repeat(at_faces, np.diff(fine.offsets)))


@pytest.mark.parametrize("name", SCHEMES)
def test_edges_fall_into_their_pieces_and_faces_into_children(name):
    shape, scheme = SCHEMES[name]
    mesh = Mesh(*shape)
    edges = mesh.topology().edges
    column = Column(np.arange(1, len(edges) + 1))
    at_edges, _ = carried("edges", column, mesh, scheme, 2)
    assert np.bincount(at_edges)[1:].tolist() == [4] * len(edges)
    children = 4 * (np.diff(mesh.offsets) if scheme.base is CATMULL_CLARK else 4 * np.ones(20))
    at_faces, _ = carried("faces", Column(np.arange(mesh.face_count)), mesh, scheme, 2)
    np.testing.assert_array_equal(np.bincount(at_faces)[:20], children[:20])


def test_directions_keep_length_one_and_nothing_stays_nothing():
    vertices, faces = grid(3)
    rng = np.random.default_rng(0)
    values = rng.normal(size=(len(vertices), 3))
    values[0] = 0
    made, _ = carried("vertices", Column(values, unit=True), Mesh(vertices, faces), loop(), 2)
    lengths = np.linalg.norm(made, axis=1)
    np.testing.assert_allclose(lengths[1:], 1)
    assert lengths[0] == 0


@pytest.mark.parametrize("base", [LOOP, CATMULL_CLARK])
@pytest.mark.parametrize("keep", ["none", "corners only", "boundaries", "all"])
def test_what_is_to_stay_of_a_chart_stays(base, keep):
    """OpenSubdiv's four rules, on the only chart of an open mesh: its border is the mesh's."""
    shape = grid(4) if base is LOOP else SHAPES["open box"]
    mesh = Mesh(uneven(shape[0]), shape[1])
    scheme = loop() if base is LOOP else catmull_clark()
    values = mesh.vertices[mesh.corners]
    made, fine = carried("corners", Column(values, rules.smooth, keep), mesh, scheme, 2)
    at = np.empty_like(fine.vertices)
    at[fine.corners] = made
    stays = (at[: len(mesh.vertices)] == mesh.vertices).all(axis=1)
    topology = mesh.topology()
    border = np.zeros(len(mesh.vertices), dtype=bool)
    border[topology.edges[topology.edge_class == 1]] = True
    alone = border & (np.bincount(mesh.corners) == 1)
    expected = {"none": border & False, "corners only": alone, "boundaries": border}
    if keep == "all":
        assert stays.all()
    else:
        np.testing.assert_array_equal(stays, expected[keep])
    if keep == "none":
        np.testing.assert_array_equal(at, fine.vertices)


def test_along_a_seam_both_sides_stay_as_they_lay():
    """Two charts that share a line of vertices: on it each side is linear, and inside it smooth."""
    mesh, apart = Mesh(*quad_grid(7)), [5.0, 0]
    left = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] < 0
    values = mesh.vertices[mesh.corners][:, :2]
    values[~np.repeat(left, 4)] += apart
    column = Column(values, rules.smooth)
    corners, fine = carried("corners", column, mesh, catmull_clark(), 2, limit=False)
    corners, positions = corners.reshape(-1, 4, 2), fine.vertices[fine.faces][..., :2]
    on_left = np.repeat(left, 16)
    # A linear function of the plane stays one, on both sides of the seam.
    np.testing.assert_allclose(np.ptp(corners[on_left][..., 0]), 1, atol=1e-12)
    moved = np.where(on_left[:, None, None], corners, corners - apart)
    inner = np.abs(positions).max(axis=(1, 2)) < 0.6
    np.testing.assert_allclose(moved[inner], positions[inner], atol=1e-12)


def test_one_row_for_each_corner_is_asked_for():
    made = refine(Mesh(*SHAPES["cube"]), "catmull-clark", 1)
    with pytest.raises(ParameterError, match="corner"):
        refine_corners(np.zeros((8, 2)), made.topologies, CATMULL_CLARK)
