"""Vertices that stay sharp: the mask (1 − κ) rule + κ p, and OpenSubdiv's sharpness."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, ParameterError, catmull_clark, load_model, loop, pns
from pns_common.interop.carried import CarriedMesh, refine_carried
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK, LOOP
from pns_common.schemes.limit import limit_positions
from tests.support import opensubdiv
from tests.support.control_points import refine
from tests.support.meshes import bumpy_sphere, grid, manifolds, soups
from tests.support.polygons import SHAPES, polygon_manifolds, polygon_soups, uneven

seeds = st.integers(0, 2**31)
meshes = st.one_of(
    st.tuples(st.just(LOOP), manifolds() | soups()),
    st.tuples(st.just(CATMULL_CLARK), polygon_manifolds() | polygon_soups()),
)


def sharpened(mesh, seed):
    """A topology with hard and soft edges at random, so smooth vertices, darts, curves, corners."""
    topology, rng = mesh.topology(), np.random.default_rng(seed)
    sharpness = rng.uniform(0, 1.5, len(topology.edges)) * (rng.random(len(topology.edges)) < 1 / 3)
    return topology.with_sharpness(np.minimum(sharpness, 1.0))


@pytest.mark.parametrize("limit", [False, True])
@given(meshes, seeds)
def test_a_corner_weight_blends_any_rule_with_staying(limit, given_mesh, seed):
    (base, mesh), rng = given_mesh, np.random.default_rng(seed)
    points, count = mesh.vertices / np.abs(mesh.vertices).max(), len(mesh.vertices)
    without = sharpened(mesh, seed)
    # The limit of a vertex with an edge to itself is that of the next mesh.
    assume(not limit or (without.edges[:, 0] != without.edges[:, 1]).all())
    weights = rng.choice([0, 0, 1 / 4, 0.7, 1], count)
    topology = without.with_vertex_sharpness(np.where(weights == 1, np.inf, weights))

    def moved(mesh):
        return (
            limit_positions(points, mesh, base=base)
            if limit
            else base.place(points, mesh, Blocks())
        )

    rule, made = moved(without), moved(topology)
    np.testing.assert_array_equal(made[count:], rule[count:])
    at = weights[:, None]
    expected = (1 - at) * rule[:count] + at * points
    np.testing.assert_allclose(made[:count], expected, rtol=0, atol=1e-14)
    same = (weights == 0) | (weights == 1)
    np.testing.assert_array_equal(made[:count][same], expected[same])


CREASES = [[], [[0, 1]], [[0, 1], [1, 5]], [[0, 1], [1, 5], [1, 3]]]
QUADS = [(SHAPES[name], [0, 1, 3, 6], c) for name in ("cube", "open box", "mixed") for c in CREASES]


def triangles(points, faces):
    """A mesh, vertices at its rim, if any, and inside, and three edges that meet them or not."""
    topology = Mesh(points, faces).topology()
    inner = topology.edges[topology.interior[[4, 9, 14]]].astype(int)
    return (points, faces.tolist()), [0, *inner[0].tolist(), len(points) - 1], inner


@pytest.mark.parametrize("sharpness", [0.25, 0.75, 1, 1.5, 2, 3, np.inf])
@pytest.mark.parametrize(
    ("shape", "vertices", "creases"),
    [*QUADS, triangles(*bumpy_sphere()), triangles(*grid(5, lambda x, y: x * y))],
)
def test_corners_equal_opensubdivs(shape, vertices, creases, sharpness):
    """At smooth vertices, darts, curves, corners and boundaries, for any sharpness."""
    points, faces = shape
    points, of_quads = uneven(points), any(len(face) == 4 for face in faces)
    pairs = np.array(creases, dtype=int).reshape(-1, 2)
    kept = Creases(pairs, vertices=vertices, vertex_sharpness=[sharpness] * 4)
    scheme, oracle = (
        (catmull_clark(), opensubdiv.catmull_clark) if of_quads else (loop(), opensubdiv.loop)
    )
    made = refine(Mesh(points, faces), scheme, 3, creases=kept).mesh
    named = [(vertex, min(sharpness, 10)) for vertex in vertices]
    expected, *_ = oracle(points, faces, 3, creases, named)
    np.testing.assert_allclose(made.vertices[made.faces], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("scheme", [loop(), pns(load_model()), pns(load_model("paper"))])
def test_corners_stay_where_they_are_for_good(scheme):
    mesh, vertices = Mesh(*bumpy_sphere()), [3, 7, 20]
    kept = Creases(vertices=vertices, learned=True, levels=2, vertex_sharpness=[np.inf] * 3)
    for limit in (False, True):
        made = refine(mesh, scheme, 3, creases=kept, limit=limit)
        np.testing.assert_array_equal(made.mesh.vertices[vertices], mesh.vertices[vertices])
        plain = refine(mesh, loop(), 3, creases=None, limit=limit).mesh.vertices
        apart = np.linalg.norm(made.mesh.vertices - plain, axis=1).max()
        assert apart <= made.report["limit_distance"] * (1 + 1e-12)


def test_the_learned_rule_corrects_a_half_sharp_vertex_by_half():
    mesh, scheme = Mesh(*bumpy_sphere()), pns(load_model())
    smooth, half = (
        refine(mesh, scheme, 1, creases=Creases(vertices=[5], vertex_sharpness=[s]))
        for s in (0, 0.5)
    )
    ours, theirs = (made.steps[0].added.displacement[5] for made in (half, smooth))
    assert np.linalg.norm(theirs) > 0
    assert np.linalg.norm(ours) <= 0.51 * np.linalg.norm(theirs)


def test_vertices_are_sharp_at_as_many_levels_as_edges_unless_said_otherwise():
    mesh = Mesh(*bumpy_sphere())
    for levels, expected in ((None, [1, 1, 1, 1]), (2, [1, 1, 0, 0])):
        made = refine(mesh, loop(), 4, creases=Creases(levels=levels, vertices=[3]))
        assert [topology.corner_weights[3] for topology in made.topologies] == expected
    told = Creases(levels=1, vertices=[3, 3, 4], vertex_sharpness=[1, 2.25, 0])
    made = refine(mesh, loop(), 4, creases=told)
    assert [topology.corner_weights[3] for topology in made.topologies] == [1, 1, 0.25, 0]
    assert not any(topology.corner_weights[4] for topology in made.topologies)


def test_a_sharp_corner_of_a_border_is_that_of_the_rule_of_corners():
    vertices, faces = grid(4, lambda x, y: x * x + x * y * y)
    mesh = Mesh(vertices, faces)
    alone = np.flatnonzero(np.bincount(faces.reshape(-1)) == 1)
    for scheme in (loop(), pns(load_model())):
        named = refine(mesh, scheme, 2, creases=Creases(vertices=alone), limit=True)
        ruled = refine(mesh, scheme, 2, creases=Creases(border="corners"), limit=True)
        np.testing.assert_array_equal(named.mesh.vertices, ruled.mesh.vertices)
        np.testing.assert_array_equal(named.normals, ruled.normals)
        assert named.report == ruled.report


def test_a_shared_border_with_corners_moves_alike_in_both_meshes():
    """Two sheets that rise unlike from a common line, with soft and hard corners on it."""
    sheets = [Mesh(*grid(9, lambda x, y, by=by: (y + 1) * by + x * x)) for by in (0.1, 0.9)]
    rim = np.flatnonzero(sheets[0].vertices[:, 1] == -1)
    kept = Creases(vertices=rim[3:6], vertex_sharpness=[0.5, 1, 0.2])
    made = [refine(mesh, pns(load_model()), 1, 1.0, creases=kept) for mesh in sheets]
    inner = rim[2:7]  # whose neighbours' neighbours are on no other border
    ours, theirs = (refined.mesh.vertices[inner] for refined in made)
    np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(ours[2], sheets[0].vertices[inner[2]])


def test_corners_follow_vertices_that_are_joined_by_position():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [5, 3, 4]])
    asked = {"creases": Creases(vertices=[4, 3])}
    made = refine_carried(CarriedMesh(points, faces), loop(), 1, asked)[0].vertices
    np.testing.assert_array_equal(made[[1, 3, 4]], points[[1, 3, 4]])
    assert (made[2] != points[2]).any()
    with pytest.raises(ParameterError, match=r"vertices\[0\]"):
        refine_carried(CarriedMesh(points, faces), loop(), 1, {"creases": Creases(vertices=[6])})


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"vertices": [0.5]}, "vertices"),
        ({"vertices": [[0, 1]]}, "vertices"),
        ({"vertices": np.ma.array([0, 1], mask=[0, 1])}, "vertices"),
        ({"vertices": [0, 25]}, r"vertices\[1\]"),
        ({"vertices": [-1]}, r"vertices\[0\]"),
        ({"vertices": [0], "vertex_sharpness": [-0.5]}, r"vertex_sharpness\[0\]"),
        ({"vertices": [0], "vertex_sharpness": [np.nan]}, r"vertex_sharpness\[0\]"),
        ({"vertices": [0], "vertex_sharpness": [1, 2]}, "vertex_sharpness"),
        ({"vertex_sharpness": [1]}, "vertex_sharpness"),
    ],
)
def test_corners_that_are_none_are_refused_by_name(arguments, name):
    with pytest.raises(ParameterError, match=name):
        refine(Mesh(*grid(5)), loop(), creases=Creases(**arguments))
