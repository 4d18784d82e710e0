"""Adaptive refinement: near enough to the limit surface, no gaps, no matter of numbering."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pns_common import Creases, Mesh, MeshError, ParameterError, load_model, loop, pns, refine
from pns_common.adaptive.certificate import slabs
from pns_common.adaptive.outlines import triangles_in
from pns_common.adaptive.parts import Levels, Part
from pns_common.mesh.rows import unit
from pns_common.mesh.topology import EdgeClass
from pns_common.parallel import Blocks
from pns_common.schemes.limit import limit_normals
from tests.support.meshes import (
    bent,
    block,
    bow_tie,
    bumpy_sphere,
    grid,
    prism,
    rotation,
    three_pages,
)

SCHEMES = {"loop": loop(), "pns": pns(load_model())}
LEVELS = 3
# What networks in single precision leave between a mesh and its mirror image.
NETWORKS = 1e-5


def drum(sides=16):
    """Return a prism over a regular polygon, its lids cut from a corner."""
    turns = 2 * np.pi * np.arange(sides) / sides
    return prism(np.stack([np.cos(turns), np.sin(turns)], axis=1))


SHAPES = {
    "bumps": lambda: bumpy_sphere(subdivisions=0, bump=0.3),
    "sheet": lambda: grid(4, bent),
    "block": lambda: block(1, noise=0.1),
    "drum": lambda: drum(6),
    "three pages": three_pages,
    "bow-tie": bow_tie,
}


def shape(name):
    made = SHAPES[name]()
    return made if isinstance(made, Mesh) else Mesh(*made[:2])


def diagonal(mesh):
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def parts(made, dense, levels):
    """Yield each face, and the vertices of the dense mesh that lie on the part it stands for."""
    weights = np.eye(3)[None]
    for _ in range(levels):
        a, b, c = weights[:, 0], weights[:, 1], weights[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        children = (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)
        weights = np.stack([np.stack(child, 1) for child in children], 1).reshape(-1, 3, 3)
    corners = dense.mesh.faces.reshape(-1, weights.shape[0] * 3)
    for row, (parent, own) in enumerate(zip(made.face_parents, made.weights, strict=True)):
        inside = (weights.reshape(-1, 3) @ np.linalg.inv(own) > -1e-9).all(axis=1)
        yield row, corners[parent][inside]


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_vertices_are_where_whole_levels_put_them(name, scheme):
    mesh = shape(name)
    made = refine(mesh, scheme, LEVELS, tolerance="0.5%")
    whole = refine(mesh, scheme, LEVELS)
    for row, own in parts(made, whole, LEVELS):
        for corner in made.mesh.faces[row]:
            away = np.linalg.norm(whole.mesh.vertices[own] - made.mesh.vertices[corner], axis=1)
            assert away.min() < 1e-12 * diagonal(mesh)
            at = own[away.argmin()]
            np.testing.assert_allclose(made.normals[corner], whole.normals[at], atol=1e-9)
    assert made.mesh.face_count <= whole.mesh.face_count


@pytest.mark.parametrize("sharpness", [1.0, 1.5, 2.5, np.inf])
@pytest.mark.parametrize("levels", [None, 1, 2])
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_edges_that_wear_off_do_so_in_parts_of_levels(sharpness, levels, scheme):
    """Also where learned and other creases end before."""
    points, faces = bumpy_sphere(subdivisions=0, bump=0.3)
    mesh = Mesh(points, faces)
    pairs = mesh.topology().edges[::4].astype(np.int64)
    given = np.full(len(pairs), sharpness)
    creases = Creases(pairs, given, wears=True, learned=True, levels=levels)
    made = refine(mesh, scheme, LEVELS, tolerance="1%", creases=creases)
    whole = refine(mesh, scheme, LEVELS, creases=creases).mesh.vertices
    away, _ = cKDTree(whole).query(made.mesh.vertices)
    assert away.max() < 1e-12


def test_vertices_of_many_faces_are_bounded():
    made = refine(drum(44), "loop", LEVELS, tolerance="1%", creases=None)
    assert (made.distances[made.face_levels < LEVELS] <= made.goal.tolerance).all()
    assert np.isfinite(made.distances).all()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("tolerance", ["2%", "0.3%"])
def test_no_point_of_the_limit_surface_is_farther_than_said(name, scheme, tolerance):
    mesh = shape(name)
    made = refine(mesh, scheme, LEVELS, tolerance=tolerance)
    dense = refine(mesh, scheme, LEVELS + 1)
    reached = made.face_levels < LEVELS
    assert (made.distances[reached] <= made.goal.tolerance).all()
    for row, own in parts(made, dense, LEVELS + 1):
        away = heights(made, dense.mesh.vertices[own], row)
        assert away.max(initial=0) <= made.distances[row] + 1e-12 * diagonal(mesh)


@pytest.mark.parametrize("name", ["bumps", "block", "drum"])
@pytest.mark.parametrize("enough", [0.0, 0.05])
def test_no_patch_is_farther_beyond_a_side_than_said(name, enough):
    mesh = shape(name)
    count, every = mesh.face_count, np.arange(mesh.face_count)
    dense = refine(mesh, "loop", 5, creases=None).mesh
    part = Part(0, mesh.topology(), mesh.vertices, np.arange(len(mesh.vertices)), every, every >= 0)
    triangles, all_sides = dense.vertices[mesh.faces], np.ones((count, 3), dtype=bool)
    levels = Levels(loop().base, Blocks(), 6, None)
    low, high, _ = slabs(part, every, triangles, all_sides, levels, 0, enough).T
    points = dense.vertices[dense.faces.reshape(count, -1)]
    a, b, c = triangles.swapaxes(0, 1)
    normal = unit(np.cross(b - a, c - a))
    height = np.einsum("fpi,fi->fp", points - a[:, None], normal)
    out = np.zeros_like(height)
    for one, other in ((a, b), (b, c), (c, a)):
        across = unit(np.cross(other - one, normal))
        out = np.maximum(out, np.einsum("fpi,fi->fp", points - one[:, None], across))
    away = np.hypot(height, out).max(axis=1)
    assert out.max() > 0
    assert (away <= np.maximum(-low, high) + 1e-12).all()


def heights(made, points, row):
    """Return distances of points from the plane of a face; if that is a piece, of those over it."""
    a, b, c = made.mesh.vertices[made.mesh.faces[row]]
    normal = np.cross(b - a, c - a)
    away = np.abs((points - a) @ normal) / max(np.linalg.norm(normal), 1e-300)
    same = (made.codes == made.codes[row]) & (made.face_levels == made.face_levels[row])
    if same.sum() == 1:
        return away
    at, places = made.at.reshape(-1, 3)[same], made.mesh.vertices[made.mesh.faces[same]]
    whole = np.stack([places[at == k][0] for k in range(3)])
    up = np.cross(whole[1] - whole[0], whole[2] - whole[0])
    inside = np.linalg.solve(np.column_stack([b - a, c - a, up]), (points - a).T)[:2].T
    return away[(inside >= 0).all(axis=1) & (inside.sum(axis=1) <= 1)]


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", [{"tolerance": "0.5%"}, {"angle": 20}, {"max_faces": 200}])
def test_faces_of_different_levels_meet_without_gaps(name, scheme, goal):
    mesh = shape(name)
    made = refine(mesh, scheme, LEVELS, **goal)
    edges, control = made.mesh.topology(), mesh.topology()
    open_edges = edges.edges[edges.edge_class != EdgeClass.INTERIOR]
    # Each is a piece of an edge that was open: both its ends lie on one side of a control face.
    of_edge = {tuple(e): k for k, e in enumerate(map(sorted, control.edges.tolist()))}
    pieces = {tuple(sorted(e)) for e in open_edges.tolist()}
    length = dict.fromkeys(np.flatnonzero(control.edge_class != EdgeClass.INTERIOR).tolist(), 0.0)
    seen = set()
    for face, parent, weights in zip(made.mesh.faces, made.face_parents, made.weights, strict=True):
        for k in range(3):
            side = tuple(sorted((face[k], face[k - 1])))
            on = np.flatnonzero((weights[[k, k - 1]] == 0).all(axis=0))
            if side in pieces:
                assert len(on) == 1
                ends = np.delete(mesh.faces[parent], on[0])
                edge = of_edge[tuple(sorted(ends.tolist()))]
                assert edge in length
                if side not in seen:
                    length[edge] += np.abs(weights[k] - weights[k - 1]).max()
                seen.add(side)
    assert seen == pieces
    assert all(total == 1 for total in length.values())


def same_faces(made, other):
    """Return whether two meshes have the same faces, in whatever order, to rounding."""
    one, two = (mesh.vertices[mesh.faces].mean(axis=1) for mesh in (made, other))
    away, _ = cKDTree(one).query(two)
    return len(one) == len(two) and away.max() < NETWORKS


GOALS = [{"tolerance": 0.02}, {"angle": 25}, {"max_faces": 300}, {"max_edge_length": 0.3}]


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", GOALS)
def test_renumbering_and_motions_move_the_result(scheme, goal):
    points, faces = bumpy_sphere(subdivisions=0, bump=0.3)
    rng = np.random.default_rng(5)
    order, turn = rng.permutation(len(points)), rotation(rng)
    new = np.empty_like(order)
    new[order] = np.arange(len(order))
    other = np.roll(new[faces], 1, axis=1)[rng.permutation(len(faces))]
    made = refine(Mesh(points, faces), scheme, LEVELS, **goal).mesh
    there = refine(Mesh(points[order] @ turn.T, other), scheme, LEVELS, **goal).mesh
    assert same_faces(made, Mesh(there.vertices @ turn, there.faces))


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", GOALS)
def test_a_mirrored_mesh_becomes_the_mirrored_result(scheme, goal):
    points, faces = bumpy_sphere(subdivisions=0, bump=0.3)
    flip = np.array([-1.0, 1.0, 1.0])
    made = refine(Mesh(points, faces), scheme, LEVELS, **goal).mesh
    there = refine(Mesh(points * flip, faces[:, ::-1]), scheme, LEVELS, **goal).mesh
    assert same_faces(made, Mesh(there.vertices * flip, there.faces[:, ::-1]))


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("most", [320, 1000])
def test_equal_errors_are_split_together_within_two_percent_of_the_number(scheme, most):
    mesh, flip = drum(), np.array([-1.0, 1.0, 1.0])
    made = refine(mesh, scheme, max_faces=most).mesh
    there = refine(Mesh(mesh.vertices * flip, mesh.faces[:, ::-1]), scheme, max_faces=most).mesh
    assert same_faces(made, Mesh(there.vertices * flip, there.faces[:, ::-1]))
    assert 0.98 * most <= made.face_count <= most


@pytest.mark.parametrize("goal", [{"tolerance": "0.1%"}, {"angle": 1}])
def test_a_cube_stays_as_it_is(goal):
    points, faces = block(1)[:2]
    made = refine(Mesh(points, faces), "pns", **goal)
    assert made.mesh.face_count == len(faces)
    np.testing.assert_array_equal(made.mesh.faces, faces)


def test_faces_take_vertices_of_any_level_on_their_sides():
    points, faces = grid(13, lambda x, y: np.where(x > 0.5, (x - 0.5) * 2, 0.0) * np.cos(3 * y))
    made = refine(Mesh(points, faces), "loop", border="corners", tolerance="0.02%")
    assert (made.at * 2 % 1 > 0).any()
    # Pieces fill their faces.
    areas = np.abs(np.linalg.det(made.weights))
    np.testing.assert_allclose(np.bincount(made.face_parents, areas), 1, atol=1e-12)


@pytest.mark.parametrize(
    ("at", "tied"),
    [
        ([0, 0.25, 0.5, 1, 2], False),
        ([0, 0.5, 1, 1.5, 2, 2.5], False),
        ([0, 0.5, 1, 1.5, 2], True),
        ([0, 0.5, 0.75, 1, 1.5, 2, 2.125], False),
    ],
)
def test_outlines_are_filled_by_triangles_of_some_area(at, tied):
    at, corners = np.array([at]), np.array([[0, 0, 0], [2, 0, 0], [1, 1.5, 0]])
    side, along = at.astype(int), (at % 1)[:, :, None]
    points = (1 - along) * corners[side % 3] + along * corners[(side + 1) % 3]
    made, found = triangles_in(at, points, np.array([[0.0, 0.0, 1.0]]))
    a, b, c = points[0, made[0]].swapaxes(0, 1)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(1.5)
    assert found.tolist() == [tied]


def test_a_rim_of_creases_is_as_near_as_its_faces_say():
    mesh = drum()
    made = refine(mesh, "loop", tolerance="0.1%", creases="angle:40")
    dense = refine(mesh, "loop", 5, creases="angle:40").mesh
    walls, tops = np.split(dense.faces, [32 * 4**5])
    curve = dense.vertices[np.intersect1d(walls, tops)][:, None]
    lids = made.face_parents >= 32
    sides = np.stack([made.mesh.faces, np.roll(made.mesh.faces, -1, axis=1)], axis=-1)
    a, b = made.mesh.vertices[sides[lids].reshape(-1, 2)].swapaxes(0, 1)
    along = b - a
    share = np.clip(((curve - a) * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    away = np.linalg.norm(curve - a - share[:, :, None] * along, axis=2).min(axis=1)
    assert 0 < away.max() <= made.distances[lids].max() <= made.goal.tolerance


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", [{"tolerance": "0.05%"}, {"angle": 2}])
def test_what_is_flat_stays_whole_beside_what_bends(scheme, goal):
    """A sheet with a bump at one end is split there alone."""
    points, faces = grid(13, lambda x, y: np.where(x > 0.5, (x - 0.5) * 2, 0.0) * np.cos(3 * y))
    made = refine(Mesh(points, faces), scheme, LEVELS, border="corners", **goal)
    x, y = points[faces][:, :, 0].max(axis=1), np.abs(points[faces][:, :, 1]).max(axis=1)
    whole = np.flatnonzero((x < -0.2) & (y < 0.9))
    assert np.isin(whole, made.face_parents[made.face_levels == 0]).all()
    assert made.face_levels.max() > 1


def worn(mesh):
    """Return creases of the library's that wear off within three levels."""
    pairs = mesh.topology().edges[::4].astype(np.int64)
    return Creases(pairs, np.linspace(0.5, 2.5, len(pairs)), wears=True)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("creases", ["auto", "angle:40", "worn"])
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_angles_are_those_of_the_limit_normals_on_the_faces_side(name, creases, scheme):
    mesh = shape(name)
    creases = worn(mesh) if creases == "worn" else creases
    made = refine(mesh, scheme, LEVELS, angle=15, creases=creases)
    whole = refine(mesh, scheme, LEVELS, creases=creases)
    # Learned edges that are more sharp than not have a side each.
    dense = whole.surface.with_creases(np.flatnonzero(whole.surface.is_sharp))
    normals = limit_normals(whole.steps[-1].points, dense)
    at_corners = normals.sectors[normals.sector_of_corner].reshape(-1, 3, 3)
    assert (made.angles[made.face_levels < LEVELS] <= 15).all()
    for row in np.flatnonzero(made.face_levels < LEVELS):
        later, code = 4 ** (LEVELS - made.face_levels[row] - 1), made.codes[row]
        # Child k begins at corner k, and so do its own first children. The last one's corners are
        # on the sides of the face.
        begins = [(4 * code + k) * later for k in range(3)]
        begins += [(4 * code + 3) * later + k * later // 4 for k in range(3)]
        six = at_corners[begins, [0, 0, 0, *([0, 1, 2] if later == 1 else [0, 0, 0])]]
        six = six[six.any(axis=1)]
        apart = np.linalg.norm(six[:, None] - six, axis=2).max(initial=0)
        assert made.angles[row] == pytest.approx(np.degrees(2 * np.arcsin(apart / 2)), abs=1e-5)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_smaller_angles_and_more_faces_turn_less(scheme):
    mesh, last = Mesh(*bumpy_sphere(subdivisions=0, bump=0.3)), 0
    for angle in (60, 30, 15):
        made = refine(mesh, scheme, angle=angle, levels=LEVELS)
        assert made.mesh.face_count > last
        last = made.mesh.face_count
    turned = np.inf
    for most in (50, 100, 200, 400):
        made = refine(mesh, scheme, angle=15, max_faces=most)
        assert 0.98 * most - 4 <= made.mesh.face_count <= most
        assert made.angles.max() <= turned + 1e-9
        turned = made.angles.max()


def test_an_angle_and_a_tolerance_both_hold():
    mesh = Mesh(*bumpy_sphere(subdivisions=0, bump=0.3))
    made = refine(mesh, "loop", tolerance="0.5%", angle=30)
    assert made.angles.max() <= 30
    assert made.distances.max() <= made.goal.tolerance
    assert made.report["adaptive"]["angle"] == 30
    assert made.report["adaptive"]["angle_max"] == made.angles.max()
    alone = refine(mesh, "loop", tolerance="0.5%")
    assert alone.mesh.face_count <= made.mesh.face_count
    assert alone.report["adaptive"]["angle_max"] is None


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("most", [200, 1000])
def test_max_faces_ends_within_two_per_cent(scheme, most):
    points, faces = bumpy_sphere(subdivisions=0, bump=0.3)
    made = refine(Mesh(points, faces), scheme, max_faces=most)
    assert 0.98 * most - 4 <= made.mesh.face_count <= most


def test_more_faces_are_never_farther():
    mesh = Mesh(*bumpy_sphere(subdivisions=0, bump=0.3))
    last = np.inf
    for most in (50, 100, 200, 400):
        uncut = refine(mesh, "pns", max_faces=most).distances.max()
        assert uncut <= last * (1 + 1e-9)
        last = uncut


def test_no_side_is_longer_than_asked():
    mesh = Mesh(*bumpy_sphere(subdivisions=0, bump=0.3))
    made = refine(mesh, "loop", max_edge_length=0.2).mesh
    corners = made.vertices[made.faces]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= 0.2


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
@pytest.mark.parametrize("goal", [*GOALS, {"tolerance": "0.1%", "max_faces": 900}])
def test_progress_moves_never_falls_and_ends_with_all_faces(scheme, goal):
    mesh, told = Mesh(*bumpy_sphere(subdivisions=0, bump=0.3)), []
    made = refine(mesh, scheme, progress=lambda *faces: told.append(faces), **goal)
    shares = [done / total for done, total in told]
    assert shares == sorted(shares)
    assert shares[0] < 0.3
    assert np.diff(shares).max() < 0.6
    assert len(set(shares)) > 2
    assert told[-1] == (made.mesh.face_count, made.mesh.face_count)


def test_an_exception_of_progress_ends_a_refinement_to_a_goal():
    def stop(done, total):
        if done > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refine(Mesh(*bumpy_sphere()), "loop", tolerance="0.1%", progress=stop)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_values_are_carried_like_positions(scheme):
    mesh = shape("bumps")
    made = refine(mesh, scheme, LEVELS, tolerance="1%", creases=None)
    parents = made.parents
    dense = np.zeros(parents.shape)
    dense[parents.rows, parents.columns] = parents.weights
    np.testing.assert_allclose(dense.sum(axis=1), 1, atol=1e-12)
    assert (parents.weights > 0).all()
    values = np.random.default_rng(0).normal(size=(len(mesh.vertices), 5))
    np.testing.assert_allclose(dense @ values, made.carry(values), atol=1e-12)
    if scheme.rule is None:
        np.testing.assert_allclose(dense @ mesh.vertices, made.mesh.vertices, atol=1e-12)
    corners = np.random.default_rng(1).normal(size=(mesh.faces.size, 2))
    carried = made.at_corners(corners)
    wanted = np.einsum("fkj,fjd->fkd", made.weights, corners.reshape(-1, 3, 2)[made.face_parents])
    np.testing.assert_allclose(carried, wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("goal", "name"),
    [
        ({"tolerance": 0}, "tolerance"),
        ({"tolerance": np.nan}, "tolerance"),
        ({"tolerance": "-1%"}, "tolerance"),
        ({"tolerance": "much"}, "tolerance"),
        ({"angle": 0}, "angle"),
        ({"angle": 180}, "angle"),
        ({"angle": np.nan}, "angle"),
        ({"angle": "10"}, "angle"),
        ({"max_edge_length": -1.0}, "max_edge_length"),
        ({"max_faces": 11}, "max_faces"),
        ({"max_faces": 100.5}, "max_faces"),
        ({"tolerance": 1.0, "limit": False}, "limit"),
        ({"tolerance": 1.0, "faces": [0]}, "faces"),
        ({"tolerance": 1.0, "levels": 17}, "levels"),
        ({"tolerance": 1.0, "progress": 1}, "progress"),
    ],
)
def test_a_goal_that_cannot_be_reached_is_refused(goal, name):
    mesh = Mesh(*block(1)[:2])
    with pytest.raises(ParameterError, match=name):
        refine(mesh, "pns", **goal)


def test_too_few_faces_say_how_many_are_possible():
    with pytest.raises(ParameterError, match="at least 12"):
        refine(Mesh(*block(1)[:2]), "pns", max_faces=3)


def test_schemes_that_cannot_are_named():
    with pytest.raises(ParameterError, match="first level alone"):
        refine(Mesh(*block(1)[:2]), pns(load_model("paper")), tolerance=1.0)
    made = refine(Mesh(*block(1)[:2]), "loop", tolerance=1.0)
    with pytest.raises(MeshError, match="several levels"):
        _ = made.topologies
