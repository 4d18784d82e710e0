"""Catmull–Clark's limits are where refinement leads; OpenSubdiv's masks and normals agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, catmull_clark, refine
from pns_common.carry.columns import level_topologies, refine_columns
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK
from pns_common.schemes import catmull_clark_limit as masks
from pns_common.schemes.limit import limit_normals, limit_positions
from tests.support import opensubdiv
from tests.support.meshes import bent
from tests.support.polygons import (
    SHAPES,
    polygon_manifolds,
    polygon_soups,
    quad_grid,
    quad_star,
    uneven,
)


def positions(points, topology):
    return limit_positions(points, topology, base=CATMULL_CLARK)


def normals(points, topology):
    return limit_normals(points, topology, base=CATMULL_CLARK)


def randomly_creased(mesh, seed):
    topology = mesh.topology()
    rng = np.random.default_rng(seed)
    return topology.with_creases(np.flatnonzero(rng.random(len(topology.edges)) < 1 / 3))


def creased(points, faces, pairs):
    topology = Mesh(points, faces).topology()
    return topology.with_creases(topology.rows_of(np.array(pairs, dtype=int).reshape(-1, 2)))


def stepped(points, topology):
    placed = CATMULL_CLARK.place(points, topology, Blocks())
    return placed, CATMULL_CLARK.split(topology, Blocks())


# --- positions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [2, 3, 4, 5, 6, 9, 40])
def test_smooth_vertices_have_the_published_mask(k):
    """(k² p + 4 Σ e_j + Σ d_j) / (k (k + 5)) on a mesh of quads."""
    points, faces = SHAPES["pillow"] if k == 2 else quad_star(k)
    points = uneven(points, k)
    beside = np.unique([v for face in faces if 0 in face for v in neighbours(face)])
    opposite = [face[(list(face).index(0) + 2) % 4] for face in faces if 0 in face]
    expected = k**2 * points[0] + 4 * points[beside].sum(axis=0) + points[opposite].sum(axis=0)
    limit = positions(points, Mesh(points, faces).topology())[0]
    np.testing.assert_allclose(limit, expected / (k * (k + 5)), atol=1e-14)


def neighbours(face):
    at = list(face).index(0)
    return face[at - 1], face[(at + 1) % 4]


@given(
    st.one_of(polygon_manifolds(), polygon_soups(repeats=False)),
    st.integers(0, 2**31),
)
def test_a_step_leaves_limits_where_they_are(mesh, seed):
    points = mesh.vertices / np.abs(mesh.vertices).max()
    topology = randomly_creased(mesh, seed)
    refined, after = stepped(points, topology)
    limit = positions(refined, after)[: len(points)]
    np.testing.assert_allclose(limit, positions(points, topology), rtol=0, atol=1e-12)


@given(st.one_of(polygon_manifolds(), polygon_soups()), st.integers(0, 2**31), st.booleans())
def test_limit_masks_are_convex(mesh, seed, soft):
    topology, rng = randomly_creased(mesh, seed), np.random.default_rng(seed)
    if soft:
        topology = topology.with_sharpness(rng.random(len(topology.edges)))
    weights = positions(np.eye(len(mesh.vertices)), topology)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-14)


@pytest.mark.parametrize("creases", [[], [[6, 7], [7, 12], [12, 13]]])
def test_deep_refinement_arrives_there(creases):
    points, faces = quad_grid(5, bent)
    topology = creased(points, faces, creases)
    named = Creases(np.array(creases, dtype=int).reshape(-1, 2))
    topologies = level_topologies(faces, len(points), 6, named, CATMULL_CLARK)
    deep = refine_columns(points, topologies, CATMULL_CLARK)[: len(points)]
    np.testing.assert_allclose(deep, positions(points, topology), rtol=0, atol=2e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_limits_equal_opensubdivs(name):
    points, faces = SHAPES[name]
    points = uneven(points)
    refined = refine(Mesh(points, faces), catmull_clark(), 2)
    limit = refine(Mesh(points, faces), catmull_clark(), 2, limit=True)
    _, expected, along, across = opensubdiv.catmull_clark(points, faces, 2)
    corners, last = refined.mesh.faces, refined.mesh.topology()
    inside = np.ones(len(last.valence), dtype=bool)
    inside[last.edges[last.sharp_edges].reshape(-1)] = False
    # OpenSubdiv lets an inner vertex of valence 2 stay, which its own masks do not.
    known = (~inside | (last.valence > 2))[corners]
    ours = limit.mesh.vertices[corners]
    np.testing.assert_allclose(ours[known], expected[known], rtol=0, atol=1e-12)
    theirs = np.cross(along, across)
    theirs /= np.linalg.norm(theirs, axis=-1, keepdims=True)
    ours = limit.normals[corners]
    shown = known & inside[corners]
    np.testing.assert_allclose(ours[shown], theirs[shown], rtol=0, atol=1e-10)


# --- normals --------------------------------------------------------------------------------------


def fan(kind, k):
    """k sectors of quads around vertex 0: all there are, or between two boundaries."""
    if kind == masks.CLOSED:
        points, faces = quad_star(k)
    else:
        points, faces = quad_star(2 * k + 2)
        faces = faces[: 4 * k]
    return points, Mesh(points, faces).topology()


@pytest.mark.parametrize(
    ("kind", "k"),
    [(masks.CLOSED, k) for k in (3, 4, 5, 7, 12)] + [(masks.CURVE, k) for k in (1, 2, 3, 4, 7, 12)],
)
def test_tangents_are_left_eigenvectors(kind, k):
    """Both masks, p's weight included, give λ times themselves one level later."""
    points, topology = fan(kind, k)
    columns = np.random.default_rng(k).standard_normal((len(points), 3))
    mask = masks.tangent_mask(kind, k)
    first = tangents(columns, topology, mask)
    second = tangents(*stepped(columns, topology), mask)
    theta = 2 * np.pi / k if kind == masks.CLOSED else np.pi / k
    rates = np.full(2, masks.eigenvalue(theta))
    if kind == masks.CURVE:
        rates[0] = 1 / 2
    if kind == masks.CURVE and k == 1:
        rates[1] = 1 / 4
    np.testing.assert_allclose(second, rates[:, None] * first, rtol=1e-9)


@pytest.mark.parametrize("k", [2, 3, 4, 5, 6, 9, 30])
def test_tangents_of_a_dart_are_left_eigenvectors(k):
    points, faces = SHAPES["pillow"] if k == 2 else quad_star(k)
    end = next(face for face in faces if 0 in face)
    topology = creased(points, faces, [[0, neighbours(end)[1]]])
    columns = np.random.default_rng(k).standard_normal((len(points), 3))
    mask = masks.tangent_mask(masks.DART, k)
    first = tangents(columns, topology, mask)
    second = tangents(*stepped(columns, topology), mask)
    ratio = second / first
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[:, :1], (2, 3)), rtol=1e-8)


def tangents(columns, topology, mask):
    """Both tangents at vertex 0, of the sector's points on the next mesh."""
    placed = CATMULL_CLARK.place(columns, topology, Blocks())
    around = masks.find_sectors(topology.connectivity)
    (row,) = np.flatnonzero(around.vertex == 0)
    h, count, edge_count = int(around.first[row]), topology.vertex_count, len(topology.edges)
    walked = []
    for _ in range(int(around.size[row])):
        f = int(topology.face_of_corner[h])
        start, stop = topology.offsets[f], topology.offsets[f + 1]
        before = h - 1 if h > start else stop - 1
        walked += [count + topology.corner_edges[h], count + edge_count + f]
        last = count + topology.corner_edges[before]
        there, back = topology.half_edges[topology.corner_edges[before]]
        h = int(back if there == before else there)
    spokes = placed[[*walked, last]] - placed[0]
    return mask.T @ spokes


@pytest.mark.parametrize("name", ["cylinder", "mixed", "torus", "open box", "star of 7"])
def test_limit_normals_are_those_of_small_faces(name):
    points, faces = SHAPES[name]
    points = uneven(points, by=0.05)
    topologies = level_topologies(faces, len(points), 6, base=CATMULL_CLARK)
    found = normals(points, topologies[0])
    deep = refine_columns(points, topologies, CATMULL_CLARK)
    small = CATMULL_CLARK.faces(topologies[-1], Blocks(), np.int64)
    corners = deep[small]
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    total = np.zeros(deep.shape)
    for corner in range(4):
        np.add.at(total, small[:, corner], area)
    smooth = topologies[0].sharp_count if len(topologies[0].sharp_count) else np.zeros(len(points))
    rows = np.flatnonzero(smooth == 0)
    unit = total[rows] / np.linalg.norm(total[rows], axis=1, keepdims=True)
    cosines = np.einsum("ij,ij->i", unit, found.vertices[rows])
    assert cosines.min() > np.cos(np.radians(3))


@given(polygon_soups())
def test_limits_of_any_faces_are_finite(mesh):
    made = refine(mesh, catmull_clark(), 1, limit=True)
    assert np.isfinite(made.mesh.vertices).all()
    lengths = np.linalg.norm(made.normals, axis=1)
    np.testing.assert_allclose(lengths[lengths > 0.5], 1, atol=1e-12)
    assert ((lengths == 0) | (lengths > 0.5)).all()
