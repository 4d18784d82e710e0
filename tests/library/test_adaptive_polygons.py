"""Polygons with a goal: near enough to the limit surface, no gaps, no matter of numbering."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pns_common import Creases, Mesh, catmull_clark, load_model, pns, refine
from pns_common.adaptive.polygons import cut
from pns_common.carry.carried import Carried, Column, refine_carried
from pns_common.carry.rules import linear
from pns_common.mesh.topology import EdgeClass
from pns_common.parallel import Blocks
from tests.support.meshes import bent, bumpy_sphere, grid, rotation, three_pages
from tests.support.polygons import (
    CUBE,
    CUBE_FACES,
    cylinder,
    mixed_cube,
    pillow,
    quad_grid,
    quad_star,
    quad_torus,
    uneven,
)

SCHEMES = {"catmull-clark": catmull_clark(), "pns": pns(load_model())}
LEVELS = 4
# What networks in single precision leave between a mesh and its mirror image.
NETWORKS = 1e-5


def shaken(made, by=0.1, seed=0):
    points, faces = made
    return uneven(points, seed, by), faces


def two_cubes():
    """Two cubes that share one vertex only."""
    faces = np.array(CUBE_FACES)
    points = np.concatenate([CUBE, CUBE[1:] * [-1, -1, -0.6]])
    # The second one is a mirror image: its faces are turned over.
    other = np.where(faces == 0, 0, faces + 7)[:, ::-1]
    return points, np.concatenate([faces, other])


SHAPES = {
    "cube": lambda: (CUBE, CUBE_FACES),
    "shaken cube": lambda: shaken((CUBE, CUBE_FACES), 0.2),
    "mixed cube": mixed_cube,
    "drum": lambda: cylinder(16),
    "shaken drum": lambda: shaken(cylinder(7)),
    "torus": quad_torus,
    "shaken torus": lambda: shaken(quad_torus(6, 5)),
    "sheet": lambda: quad_grid(5, bent),
    "steep sheet": lambda: quad_grid(4, lambda x, y: 3 * bent(x, y)),
    "star of three": lambda: shaken(quad_star(3)),
    "star of nine": lambda: shaken(quad_star(9)),
    "pillow": lambda: shaken(pillow(), 0.05),
    "two cubes": two_cubes,
    "triangles": lambda: bumpy_sphere(subdivisions=0, bump=0.3),
    "open triangles": lambda: grid(4, bent),
    "three pages": three_pages,
}
MARKED = {
    "none": lambda mesh: None,
    "auto": lambda mesh: "auto",
    "angle": lambda mesh: "angle:40",
    "corners": lambda mesh: Creases(border="corners"),
    "half": lambda mesh: Creases(some(mesh), np.full(len(some(mesh)), 0.7)),
    "wears": lambda mesh: Creases(some(mesh), np.full(len(some(mesh)), 1.5), wears=True),
}


def some(mesh):
    topology = mesh.topology()
    return topology.edges[topology.edge_class == EdgeClass.INTERIOR][::3].astype(np.int64)


def shape(name):
    return Mesh(*SHAPES[name]())


def learned(mesh):
    """Return the model's scheme for polygons; of triangles, which it has another for, the rules."""
    return "catmull-clark" if mesh.triangles else "pns"


def diagonal(mesh):
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def directed(mesh):
    """Return the edges of faces in their direction."""
    after = np.arange(1, len(mesh.corners) + 1)
    after[mesh.offsets[1:] - 1] = mesh.offsets[:-1]
    return np.stack([mesh.corners, mesh.corners[after]], axis=1)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("marked", ["auto", "half", "wears"])
def test_vertices_are_where_whole_levels_put_them(name, marked):
    mesh = shape(name)
    creases = MARKED[marked](mesh)
    made = refine(mesh, learned(mesh), LEVELS, tolerance="1%", creases=creases)
    whole = refine(mesh, learned(mesh), LEVELS, creases=creases)
    away, at = cKDTree(whole.mesh.vertices).query(made.mesh.vertices)
    assert away.max() < 1e-12 * diagonal(mesh)
    assert made.mesh.face_count <= whole.mesh.face_count
    # Where sharp edges meet, a side may turn over from one level to the next.
    first = refine(mesh, learned(mesh), 1, creases=creases).normals
    steady = np.ones(len(whole.normals), dtype=bool)
    old = np.arange(len(mesh.vertices))
    steady[old] = np.abs(first[old] - whole.normals[old]).max(axis=1) < 1e-9
    same = steady[at]
    assert same[len(old) :].all()
    np.testing.assert_allclose(made.normals[same], whole.normals[at[same]], atol=1e-9)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", [{"tolerance": "0.5%"}, {"max_faces": 200}])
def test_faces_of_different_levels_meet_without_gaps(name, scheme, goal):
    mesh = shape(name)
    if mesh.triangles:
        scheme = catmull_clark()
    made = refine(mesh, scheme, LEVELS, **goal)
    topology, control = made.mesh.topology(), mesh.topology()
    # An edge of two faces has them in opposite directions; others lie on such edges of the mesh.
    other = topology.edge_class != EdgeClass.INTERIOR
    length = np.zeros(len(control.edges))
    rows, weights = made.quads
    after = np.arange(1, len(rows) + 1)
    after[made.mesh.offsets[1:] - 1] = made.mesh.offsets[:-1]
    seen = set()
    for corner in np.flatnonzero(other[topology.corner_edges]):
        ends = [along_side(rows[k], weights[k], control) for k in (corner, after[corner])]
        [edge] = {e for e, _ in ends[0]} & {e for e, _ in ends[1]}
        assert control.edge_class[edge] != EdgeClass.INTERIOR
        if topology.corner_edges[corner] not in seen:
            seen.add(topology.corner_edges[corner])
            length[edge] += abs(dict(ends[0])[edge] - dict(ends[1])[edge])
    wanted = control.edge_class != EdgeClass.INTERIOR
    np.testing.assert_allclose(length, wanted, atol=1e-12)


def along_side(h, weights, control):
    """Return the control edges that a corner lies on, and how far from the lower end."""
    [face] = control.face_of(np.array([h]))
    begin, end = control.offsets[face], control.offsets[face + 1]
    before = h - 1 if h > begin else end - 1
    after = h + 1 if h + 1 < end else begin
    found = []
    if weights[2] == weights[3] == 0:
        found.append((control.corner_edges[h], control.corners[h], weights[1] / 2, after))
    if weights[1] == weights[2] == 0:
        found.append((control.corner_edges[before], control.corners[h], weights[3] / 2, before))
    return [
        (int(edge), at if start == control.edges[edge, 0] else 1 - at)
        for edge, start, at, _ in found
    ]


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("marked", MARKED)
def test_no_point_of_the_limit_surface_is_farther_than_said(name, marked):
    mesh = shape(name)
    creases = MARKED[marked](mesh)
    made = refine(mesh, learned(mesh), LEVELS, tolerance="1%", creases=creases)
    # What wears off does so down to the deepest level.
    levels = LEVELS + (marked != "wears")
    dense = refine(mesh, learned(mesh), levels, creases=creases).mesh
    reached = made.face_levels < LEVELS
    assert (made.distances[reached] <= made.goal.tolerance).all()
    corners = dense.faces.reshape(-1, 4)
    faces, control = made.mesh.polygons, mesh.topology()
    for level in range(LEVELS + 1):
        own = np.flatnonzero(made.face_levels == level)
        for code in np.unique(made.codes[own]):
            rows = own[made.codes[own] == code]
            if level:
                each = 4 ** (levels - level)
                patch = corners[code * each : (code + 1) * each]
            else:
                each = 4 ** (levels - 1)
                begin, end = control.offsets[code : code + 2]
                patch = corners[begin * each : end * each]
            points = dense.vertices[np.unique(patch)]
            for row in rows:
                away = over(made.mesh.vertices[faces[row]], points, plane(made, rows, faces))
                assert away.max(initial=0) <= made.distances[row] + 1e-12 * diagonal(mesh)


def plane(made, rows, faces):
    """Return the normal of the polygon of which some faces are parts."""
    whole = made.mesh.vertices[np.concatenate([faces[row] for row in rows])]
    if len(rows) == 1:
        corners = made.mesh.vertices[faces[rows[0]]]
    else:
        at = made.at[np.concatenate([np.arange(*made.mesh.offsets[[r, r + 1]]) for r in rows])]
        corners = np.stack([whole[at == k][0] for k in range(4) if (at == k).any()])
    if made.face_levels[rows[0]] == 0 and len(rows) == 1:
        at = made.at[slice(*made.mesh.offsets[[rows[0], rows[0] + 1]])]
        corners = corners[at % 1 == 0]
    return sum(np.cross(corners[k - 1], corners[k]) for k in range(len(corners)))


def over(face, points, normal):
    """Return distances along a normal between points and triangles of a face that they lie over."""
    size = np.linalg.norm(normal)
    if size == 0:
        return np.zeros(0)
    found = [np.zeros(0)]
    for first in range(len(face) if len(face) < 5 else 1):
        fan = np.roll(face, -first, axis=0)
        a = fan[0]
        for b, c in pairwise(fan[1:]):
            frame = np.column_stack([b - a, c - a, normal / size])
            if abs(np.linalg.det(frame)) < 1e-12 * size:
                continue
            u, v, h = np.linalg.solve(frame, (points - a).T)
            found.append(np.abs(h[(u >= 0) & (v >= 0) & (u + v <= 1)]))
    return np.concatenate(found)


def same_faces(made, other):
    """Return whether two meshes have the same faces, in whatever order, to rounding."""
    one, two = (
        np.stack([mesh.vertices[face].mean(axis=0) for face in mesh.polygons])
        for mesh in (made, other)
    )
    away, _ = cKDTree(one).query(two)
    return len(one) == len(two) and away.max() < NETWORKS


GOALS = [{"tolerance": 0.02}, {"max_faces": 300}, {"max_edge_length": 0.3}]


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("name", ["shaken torus", "shaken drum"])
def test_renumbering_and_motions_move_the_result(name, scheme, goal):
    mesh = shape(name)
    points, faces = mesh.vertices, mesh.polygons
    rng = np.random.default_rng(5)
    order, turn = rng.permutation(len(points)), rotation(rng)
    new = np.empty_like(order)
    new[order] = np.arange(len(order))
    other = [np.roll(new[faces[k]], 1).tolist() for k in rng.permutation(len(faces))]
    made = refine(mesh, scheme, LEVELS, **goal).mesh
    there = refine(Mesh(points[order] @ turn.T, other), scheme, LEVELS, **goal).mesh
    assert same_faces(made, Mesh(there.vertices @ turn, there.polygons))


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("name", ["shaken torus", "shaken drum"])
def test_a_mirrored_mesh_becomes_the_mirrored_result(name, scheme, goal):
    mesh, flip = shape(name), np.array([-1.0, 1.0, 1.0])
    backwards = [face[::-1].tolist() for face in mesh.polygons]
    made = refine(mesh, scheme, LEVELS, **goal).mesh
    there = refine(Mesh(mesh.vertices * flip, backwards), scheme, LEVELS, **goal).mesh
    assert same_faces(made, Mesh(there.vertices * flip, there.polygons))


def test_a_cube_stays_as_it_is():
    made = refine(Mesh(CUBE, CUBE_FACES), "pns", tolerance="0.1%")
    np.testing.assert_array_equal(made.mesh.faces, CUBE_FACES)


@pytest.mark.parametrize("name", ["drum", "sheet", "steep sheet", "star of three"])
@pytest.mark.parametrize("tolerance", ["1%", "0.1%"])
def test_rims_are_as_near_as_faces_say(name, tolerance):
    mesh = shape(name)
    made = refine(mesh, "catmull-clark", tolerance=tolerance, creases="angle:80")
    dense = refine(mesh, "catmull-clark", 5, creases="angle:80")
    last = dense.scheme.base.split(dense.topologies[-1], Blocks())
    curve = dense.mesh.vertices[np.unique(last.edges[last.edge_class != EdgeClass.INTERIOR])]
    sharp = made.control.topology.edge_class != EdgeClass.INTERIOR
    sides = made.mesh.topology()
    on = (made.edge_parents >= 0) & sharp[made.edge_parents]
    ends = made.mesh.vertices[sides.edges[np.unique(sides.corner_edges[on])].astype(np.int64)]
    a, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    share = ((curve[:, None] - a) * along).sum(axis=2) / (along**2).sum(axis=1)
    away = curve[:, None] - a - np.clip(share, 0, 1)[:, :, None] * along
    farthest = np.linalg.norm(away, axis=2).min(axis=1).max()
    assert 0 < farthest <= made.distances.max() <= made.goal.tolerance


def test_a_drum_keeps_its_lids():
    made = refine(Mesh(*cylinder(16)), "pns", tolerance="0.1%")
    sizes = np.diff(made.mesh.offsets)
    assert made.face_parents[sizes > 4].tolist() == [0, 1]
    assert sizes[2:].max() == 4
    assert (sizes[:2] > 16).all()


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_quads_differ_by_one_level_at_most(scheme):
    """A spike in a plane: no quad below the control mesh has two new vertices inside of a side."""
    points, faces = quad_grid(9, lambda x, y: np.exp(-40 * (x**2 + y**2)))
    made = refine(Mesh(points, faces), scheme, tolerance="0.05%")
    counts = np.diff(made.mesh.offsets)
    inside = np.repeat(made.face_levels > 0, counts)
    assert set((made.at[inside] % 1).tolist()) == {0.0, 0.5}
    assert counts[made.face_levels > 0].max() == 4
    assert made.face_levels.max() - made.face_levels.min() > 2


def test_pieces_of_cut_faces_mirror_and_turn():
    """The pattern of turned or mirrored sides is the turned or mirrored pattern."""

    def pieces(n, sides):
        outline = sorted([*range(n), *(k + 0.5 for k in sides)])
        table, counts = cut(n, sum(1 << k for k in sides))
        rows = np.split(np.array(outline)[table], np.cumsum(counts)[:-1])
        return {frozenset(row.tolist()) for row in rows}

    for n in (3, 4):
        for bits in range(1, 2**n - (n == 4)):
            sides = [k for k in range(n) if bits >> k & 1]
            own = pieces(n, sides)
            turned = pieces(n, [(k + 1) % n for k in sides])
            assert turned == {frozenset((x + 1) % n for x in piece) for piece in own}
            mirrored = pieces(n, [n - 1 - k for k in sides])
            assert mirrored == {frozenset(-x % n for x in piece) for piece in own}
            area = sum(len(piece) - 2 for piece in own)
            assert area == n + len(sides) - 2


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("most", [200, 1000])
def test_max_faces_ends_within_two_per_cent(scheme, most):
    made = refine(shape("shaken torus"), scheme, max_faces=most)
    assert 0.98 * most - 4 <= made.mesh.face_count <= most


def test_more_faces_are_never_farther():
    last = np.inf
    for most in (50, 100, 200, 400):
        farthest = refine(shape("shaken torus"), "pns", max_faces=most).distances.max()
        assert farthest <= last * (1 + 1e-9)
        last = farthest


def test_no_side_is_longer_than_asked():
    """But lines across faces that are cut beside finer ones, up to the half of √5 times it."""
    made = refine(shape("shaken torus"), "catmull-clark", max_edge_length=0.4)
    ends = directed(made.mesh)
    size = np.linalg.norm(np.subtract(*made.mesh.vertices[ends.T]), axis=1)
    counts = np.diff(made.mesh.offsets)
    whole = np.repeat((counts == 4) & (made.at[made.mesh.offsets[:-1]] == 0), counts)
    assert size[whole].max() <= 0.4
    assert size.max() <= 0.4 * 1.3


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_values_are_carried_like_positions(scheme):
    mesh = shape("shaken drum")
    made = refine(mesh, scheme, LEVELS, tolerance="1%", creases=None)
    parents = made.parents
    dense = np.zeros(parents.shape)
    dense[parents.rows, parents.columns] = parents.weights
    np.testing.assert_allclose(dense.sum(axis=1), 1, atol=1e-12)
    values = np.random.default_rng(0).normal(size=(len(mesh.vertices), 5))
    np.testing.assert_allclose(dense @ values, made.carry(values), atol=1e-12)
    if scheme.rule is None:
        np.testing.assert_allclose(dense @ mesh.vertices, made.mesh.vertices, atol=1e-12)


def test_values_of_corners_are_those_of_whole_levels():
    """All faces split so often: what corners carry is that of uniform refinement."""
    mesh = shape("shaken drum")
    values = np.random.default_rng(1).normal(size=(len(mesh.corners), 2))
    made = refine(mesh, "catmull-clark", 3, tolerance=1e-12)
    assert set(made.face_levels) == {3}
    whole = refine(mesh, "catmull-clark", 3)
    columns = Carried(corners={"uv": Column(values, linear)})
    carried = refine_carried(columns, whole.topologies, whole.scheme.base).corners["uv"].values
    np.testing.assert_allclose(made.at_corners(values), carried, atol=1e-12)
    np.testing.assert_array_equal(made.mesh.faces, whole.mesh.faces)
