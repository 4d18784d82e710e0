"""Sharp and soft edges: hard rules at 0 and 1, continuous in between, found by their angle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, ParameterError, load_model, loop, pns, refine, sharp_edges
from pns_common.mesh.topology import EdgeClass, build_topology
from pns_common.parallel import Blocks
from pns_common.schemes import LOOP
from tests.support.meshes import bumpy_sphere, grid, manifolds, soups
from tests.support.polygons import renumbered

seeds = st.integers(0, 2**31)


def placed(mesh, sharpness):
    topology = build_topology(mesh.faces, len(mesh.vertices)).with_sharpness(sharpness)
    return LOOP.place(mesh.vertices, topology, Blocks())


@given(soups() | manifolds(), seeds)
def test_sharpness_0_and_1_are_the_smooth_rules_and_those_of_creases(mesh, seed):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    some = np.random.default_rng(seed).random(len(topology.edges)) < 0.3
    hard = LOOP.place(mesh.vertices, topology.with_creases(np.flatnonzero(some)), Blocks())
    np.testing.assert_array_equal(placed(mesh, some.astype(float)), hard)


@given(manifolds(), seeds)
def test_new_vertices_are_lipschitz_in_sharpness(mesh, seed):
    """Also where edges change places in the order of sharpness at a vertex."""
    rng = np.random.default_rng(seed)
    count = len(build_topology(mesh.faces, len(mesh.vertices)).edges)
    size, step = np.ptp(mesh.vertices), 1e-7
    base = np.round(rng.uniform(0, 1, count) * 4) / 4  # with ties
    moved = np.clip(base + step * rng.uniform(-1, 1, count), 0, 1)
    apart = np.abs(placed(mesh, base) - placed(mesh, moved)).max()
    assert apart <= 8 * step * size


def test_soft_edges_blend_the_two_rules():
    vertices, faces = grid(5, lambda x, y: abs(x))
    mesh = Mesh(vertices, faces)
    topology = build_topology(faces, len(vertices))
    rows = topology.interior[::3]
    sharpness = np.zeros(len(topology.edges))
    at = len(vertices) + rows
    smooth, sharp = placed(mesh, sharpness)[at], placed(mesh, np.where(True, 1.0, sharpness))[at]
    sharpness[rows] = 0.25
    np.testing.assert_allclose(placed(mesh, sharpness)[at], 0.75 * smooth + 0.25 * sharp)


def test_named_creases_stay_sharp_and_others_end_after_their_levels():
    mesh = Mesh(*bumpy_sphere())
    pairs = build_topology(mesh.faces, len(mesh.vertices)).edges[:3].astype(np.int64)
    kept = refine(mesh, loop(), 3, creases=pairs).report["levels"]
    assert [level["edges"]["crease"] for level in kept] == [3, 6, 12]
    ended = refine(mesh, loop(), 3, creases=Creases(pairs, levels=2)).report["levels"]
    assert [level["edges"].get("crease", 0) for level in ended] == [3, 6, 0]


def ridge(*turns):
    """Pairs of triangles along the x axis, each bent by its own angle."""
    vertices = [[float(i), 0.0, 0.0] for i in range(len(turns) + 1)]
    faces = []
    for i, turn in enumerate(turns):
        left, right = len(vertices), len(vertices) + 1
        vertices += [
            [i + 0.5, -np.cos(turn / 2), -np.sin(turn / 2)],
            [i + 0.5, np.cos(turn / 2), -np.sin(turn / 2)],
        ]
        faces += [[i, i + 1, right], [i + 1, i, left]]
    return Mesh(vertices, faces)


def test_an_angle_of_ones_own_finds_all_edges_beyond_it():
    mesh = ridge(*np.radians([20, 35, 50]))
    assert [len(sharp_edges(mesh, angle)) for angle in (10, 30, 40, 60)] == [3, 2, 1, 0]
    for wrong in (0, 180, -1, np.nan, "40"):
        with pytest.raises((ParameterError, TypeError), match="angle"):
            sharp_edges(mesh, wrong)


@given(manifolds(), seeds)
def test_sharp_edges_do_not_depend_on_numbering(mesh, seed):
    other, order = renumbered(mesh, seed)
    pairs = {frozenset(order[pair].tolist()) for pair in sharp_edges(mesh)}
    assert {frozenset(pair.tolist()) for pair in sharp_edges(other)} == pairs


@pytest.mark.parametrize(
    ("creases", "name"),
    [
        ("sharp", "creases"),
        ([[0, 1, 2]], r"creases\.shape"),
        ([[0.0, 1.0]], r"creases\.dtype"),
        ([[0, 1], [2]], r"creases\[1\]"),
        ([[0, 99]], r"creases\[0\]"),
        (np.ma.array([[0, 1]], mask=[[0, 1]]), r"creases\.mask"),
    ],
)
def test_creases_that_are_no_edges_are_refused_by_name(creases, name):
    with pytest.raises((ParameterError, TypeError), match=name):
        refine(Mesh(*grid(3)), loop(), creases=creases)


def border_points(mesh, border, scheme):
    made = refine(mesh, scheme, 2, creases=None, border=border, limit=True)
    return made.mesh.vertices


@pytest.mark.parametrize("scheme", [loop(), pns(load_model())], ids=["loop", "pns"])
def test_a_fixed_border_stays_as_it_is_and_corners_are_vertices_of_one_face(scheme):
    vertices, faces = grid(4, lambda x, y: x * x + x * y * y)
    mesh = Mesh(vertices, faces)
    topology = build_topology(faces, len(vertices))
    ends = topology.edges[topology.edge_class == EdgeClass.BOUNDARY]
    alone = np.flatnonzero(np.bincount(faces.reshape(-1)) == 1)
    rim = np.unique(ends)
    moved = {
        border: border_points(mesh, border, scheme) for border in ("smooth", "corners", "fixed")
    }
    still = {b: (points[rim] == vertices[rim]).all(axis=1) for b, points in moved.items()}
    assert len(alone) == 2
    assert not still["smooth"][np.isin(rim, alone)].any()
    assert rim[still["corners"]].tolist() == alone.tolist()
    assert still["fixed"].all()
    # The middles of the border's edges and of their halves lie on them, evenly.
    refined = Mesh(moved["fixed"], refine(mesh, scheme, 2, creases=None).mesh.faces)
    a, b = vertices[ends[:, :1]], vertices[ends[:, 1:]]
    wanted = np.concatenate([a + (b - a) * t / 4 for t in (1, 2, 3)]).reshape(-1, 3)
    found = {tuple(row) for row in np.round(refined.vertices, 9).tolist()}
    assert {tuple(row) for row in np.round(wanted, 9).tolist()} <= found


def test_another_border_is_refused():
    with pytest.raises(ParameterError):
        Creases(border="round")
