"""Catmull–Clark's masks against OpenSubdiv, a slow oracle, and the published spectrum."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, MeshError, catmull_clark, loop
from pns_common.carry.columns import level_topologies
from pns_common.mesh.topology import build_topology, split_quads
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK
from tests.support import opensubdiv
from tests.support.control_points import refine
from tests.support.meshes import bent, manifolds
from tests.support.polygons import (
    SHAPES,
    mixed_cube,
    polygon_manifolds,
    polygon_soups,
    quad_grid,
    uneven,
)


def slow_step(points, faces, sharpness):
    """One level, face by face and vertex by vertex, of faces in general; rows as designed.

    ``sharpness`` gives w of an edge between its ends, where it is neither 0 nor that of a boundary.
    """
    sides = {}
    for f, face in enumerate(faces):
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            sides.setdefault(frozenset((a, b)), []).append((a, b, f))
    whole = [len(set(face)) == len(face) for face in faces]
    centres = [np.mean([points[v] for v in face], axis=0) for face in faces]
    sharp, at_edges = {}, []
    for edge, uses in sides.items():
        a, b = uses[0][:2]
        opposite = len(uses) == 2 and uses[0][:2] == uses[1][1::-1]
        smooth = opposite and all(whole[f] for _, _, f in uses)
        w = sharpness.get(edge, 0.0) if smooth else 1.0
        sharp[edge] = w
        middle = (points[a] + points[b]) / 2
        if smooth:
            around = (points[a] + points[b] + centres[uses[0][2]] + centres[uses[1][2]]) / 4
            middle = (1 - w) * around + w * middle
        at_edges.append(middle)
    at_vertices = []
    for v, p in enumerate(points):
        beside, inside = [], []
        for f, face in enumerate(faces):
            for i, corner in enumerate(face):
                if corner == v:
                    beside.append((points[face[i - 1]] + points[face[(i + 1) % len(face)]]) / 2)
                    inside.append(centres[f])
        k = len(inside)
        smooth = p
        if k >= 2:
            smooth = (k - 2) / k * p + (np.mean(beside, axis=0) + np.mean(inside, axis=0)) / k
        ends = [(w, *(edge - {v} or {v})) for edge, w in sharp.items() if v in edge]
        # An edge from a vertex to itself ends there twice.
        ends += [(w, v) for edge, w in sharp.items() if edge == {v}]
        ends = sorted((end for end in ends if end[0] > 0), key=lambda end: -end[0])
        second = ends[1][0] if len(ends) > 1 else 0.0
        third = ends[2][0] if len(ends) > 2 else 0.0
        curve = p
        if second > 0:
            curve = 3 / 4 * p + (points[ends[0][1]] + points[ends[1][1]]) / 8
        at_vertices.append((1 - second) * smooth + (second - third) * curve + third * p)
    return np.array(at_vertices + at_edges + centres)


def rows_of(mesh):
    return [face.tolist() for face in mesh.polygons]


def creased(mesh, seed, soft):
    """A topology with random sharp and soft edges, and the sharpness by ends."""
    topology, rng = mesh.topology(), np.random.default_rng(seed)
    sharpness = rng.random(len(topology.edges)) * (rng.random(len(topology.edges)) < 1 / 3)
    sharpness = sharpness if soft else np.ceil(sharpness)
    # Distinct weights, so that no order of equals is asked for.
    topology = topology.with_sharpness(sharpness)
    named = zip(topology.edges.tolist(), sharpness, strict=True)
    return topology, {frozenset(ends): w for ends, w in named}


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_equals_opensubdiv(name, levels):
    points, faces = SHAPES[name]
    points = uneven(points)
    refined = refine(Mesh(points, faces), catmull_clark(), levels).mesh
    expected, *_ = opensubdiv.catmull_clark(points, faces, levels)
    np.testing.assert_allclose(refined.vertices[refined.faces], expected, rtol=0, atol=1e-12)


CREASES = {
    "dart": [[0, 1]],
    "curve": [[0, 1], [1, 5]],
    "corner": [[0, 1], [1, 5], [1, 3]],
    "loop": [[0, 1], [1, 3], [3, 2], [2, 0]],
    "from the boundary": [[0, 4], [4, 6]],
}


@pytest.mark.parametrize(
    "sharpness",
    [[0.5], [1], [1.25], [2], [3.5], [np.inf], [0.25, 0.75, 0.5, 1], [3, 0.5, 1.25, 0.875]],
)
@pytest.mark.parametrize("shape", ["cube", "open box", "mixed", "triangles"])
@pytest.mark.parametrize("name", CREASES)
def test_every_crease_equals_opensubdiv(name, shape, sharpness):
    """Also Loop's; pairs alone are sharp for good, and w of one level is a sharpness below 1."""
    points, faces = SHAPES["open box" if shape == "triangles" else shape]
    scheme, oracle = catmull_clark(), opensubdiv.catmull_clark
    if shape == "triangles":
        faces = [[f[0], f[k], f[k + 1]] for f in faces for k in (1, 2)]
        scheme, oracle = loop(), opensubdiv.loop
    sides = {frozenset(pair) for f in faces for pair in zip(f, [*f[1:], f[0]], strict=True)}
    pairs = [pair for pair in CREASES[name] if frozenset(pair) in sides]
    mesh, sharpness = Mesh(uneven(points), faces), np.resize(sharpness, len(pairs)).astype(float)
    given = np.minimum(sharpness, 10)
    expected, *_ = oracle(mesh.vertices, faces, 3, pairs, sharpness=given)
    alike = [Creases(np.array(pairs), sharpness, wears=True, levels=1)]
    if sharpness.max() <= 1 and np.ptp(sharpness) == 0:
        alike.append(Creases(np.array(pairs), sharpness=sharpness, levels=1))
    if np.isinf(sharpness).all():
        alike.append(np.array(pairs))
    for creases in alike:
        made = refine(mesh, scheme, 3, creases=creases).mesh
        np.testing.assert_allclose(made.vertices[made.faces], expected, rtol=0, atol=1e-12)


@given(
    st.one_of(polygon_manifolds(), polygon_soups(), manifolds()),
    st.integers(0, 2**31),
    st.booleans(),
)
def test_masks_equal_a_slow_and_obvious_oracle(mesh, seed, soft):
    points = mesh.vertices / np.abs(mesh.vertices).max()
    topology, sharpness = creased(Mesh(points, rows_of(mesh)), seed, soft)
    placed = CATMULL_CLARK.place(points, topology, Blocks())
    expected = slow_step(points, rows_of(mesh), sharpness)
    if not soft:  # which of several equal edges are the sharpest is not laid down
        several = np.flatnonzero(topology.sharpest.weights[:, 2] == 1) if topology.sharpest else []
        np.testing.assert_array_equal(placed[several], points[several])
    np.testing.assert_allclose(placed, expected, rtol=0, atol=1e-12)


# --- connectivity ---------------------------------------------------------------------------------


@given(st.one_of(polygon_manifolds(), polygon_soups(repeats=False)), st.integers(0, 2**31))
def test_the_split_by_arithmetic_is_the_split_by_search(mesh, seed):
    topology, _ = creased(mesh, seed, soft=True)
    assert topology.plain or topology.triangles
    for _ in range(3):
        split = split_quads(topology, Blocks(2, rows=3))
        searched = build_topology((split.corners, split.offsets), split.vertex_count)
        for name in ("edges", "corner_edges", "half_edges", "face_of_corner"):
            np.testing.assert_array_equal(getattr(split, name), getattr(searched, name))
        own, found = split.without_creases().edge_class, searched.edge_class
        np.testing.assert_array_equal(own, found)
        expected = sorted(np.repeat(topology.sharpness[topology.sharpness > 0], 2).tolist())
        assert sorted(split.sharpness[split.sharpness > 0].tolist()) == expected
        topology = split


def test_new_vertices_and_quads_are_numbered_as_designed():
    """Old vertices, then V + e, then V + E + f; the quad of corner j follows that of j − 1."""
    points, faces = mixed_cube()
    mesh = Mesh(points, faces)
    topology, refined = mesh.topology(), refine(mesh, catmull_clark(), 1).mesh
    count, edge_count, quads = len(points), len(topology.edges), iter(refined.faces.tolist())
    edges = {frozenset(ends): e for e, ends in enumerate(topology.edges.tolist())}
    for f, face in enumerate(faces):
        for j, vertex in enumerate(face):
            leaving = edges[frozenset((vertex, face[(j + 1) % len(face)]))]
            entering = edges[frozenset((face[j - 1], vertex))]
            centre = count + edge_count + f
            assert next(quads) == [vertex, count + leaving, centre, count + entering]
    assert next(quads, None) is None


def test_a_regular_grid_is_the_bicubic_b_spline():
    """Inside, one level is the tensor product of (1, 4, 1)/8 … masks, and curves stay B-splines."""
    points, faces = quad_grid(6, bent)
    table = points.reshape(6, 6, 3)
    mesh = Mesh(points, faces)
    refined = refine(mesh, catmull_clark(), 1).mesh
    mask = np.array([1, 6, 1]) / 8
    for i in range(1, 5):
        for j in range(1, 5):
            expected = np.einsum("i,j,ijk->k", mask, mask, table[i - 1 : i + 2, j - 1 : j + 2])
            np.testing.assert_allclose(refined.vertices[6 * i + j], expected, atol=1e-15)


# --- front doors ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cube", "mixed", "cylinder"])
def test_faces_may_come_as_a_list_an_array_or_corners_with_offsets(name):
    points, faces = SHAPES[name]
    mesh = Mesh(points, faces)
    offsets = np.cumsum([0, *map(len, faces)])
    again = Mesh(points, (np.concatenate(faces), offsets))
    np.testing.assert_array_equal(again.corners, mesh.corners)
    np.testing.assert_array_equal(again.offsets, mesh.offsets)
    assert again.face_count == len(faces)
    if name == "cube":
        np.testing.assert_array_equal(Mesh(points, np.array(faces)).corners, mesh.corners)


@pytest.mark.parametrize(
    "offsets", [[0, 3], [1, 4], [0, 2, 4], [0, 5], [0, 4, 3, 4], [], [0.0, 4.0]]
)
def test_offsets_that_are_none_are_refused(offsets):
    with pytest.raises(MeshError, match="expected"):
        Mesh(np.eye(3)[[0, 1, 2, 0]], (np.arange(4), np.array(offsets)))


def test_schemes_go_by_name():
    for name, scheme in (("loop", loop()), ("catmull-clark", catmull_clark())):
        mesh = Mesh(*SHAPES["cube"]).triangulated()
        expected = refine(mesh, scheme, 1).mesh.vertices
        np.testing.assert_array_equal(refine(mesh, name, 1).mesh.vertices, expected)


def test_loop_refuses_polygons_and_says_what_takes_them():
    with pytest.raises(MeshError, match="catmull-clark"):
        refine(Mesh(*SHAPES["cube"]), loop(), 1)
    with pytest.raises(MeshError, match="triangles"):
        level_topologies(SHAPES["cube"][1], 8, 1)
