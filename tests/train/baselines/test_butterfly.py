import numpy as np
import pytest

from pns_common import Mesh, refine
from pns_common.connectivity.topology import EdgeClass, build_topology
from tests.support.meshes import bent, grid
from train.baselines.butterfly import butterfly_edge_vertices, modified_butterfly, star_weights


def edge_vertices_where(vertices, faces, wanted):
    topology = build_topology(faces, len(vertices))
    placed = butterfly_edge_vertices(vertices, topology)
    middle = vertices[topology.edges].mean(axis=1)
    return placed[wanted(middle)], middle[wanted(middle)]


def cubic(x, y):
    return 1 + x - 2 * y + x * x - x * y + 3 * y * y + x**3 - 2 * x * x * y + x * y * y - 0.5 * y**3


def test_reproduces_cubics_on_the_regular_grid():
    vertices, faces = grid(9, cubic)
    inside, middle = edge_vertices_where(
        vertices, faces, lambda m: (np.abs(m[:, :2]) < 0.6).all(axis=1)
    )
    assert len(inside) > 50
    np.testing.assert_allclose(inside[:, 2], cubic(*middle[:, :2].T), atol=1e-13)


def test_does_not_reproduce_quartics():
    vertices, faces = grid(9, lambda x, y: x**4)
    inside, middle = edge_vertices_where(vertices, faces, lambda m: np.abs(m[:, 0]) < 0.6)
    assert np.abs(inside[:, 2] - middle[:, 0] ** 4).max() > 1e-4


def test_boundary_edges_reproduce_cubics_along_the_boundary():
    vertices, faces = grid(9, lambda x, y: y**3 - y)
    topology = build_topology(faces, len(vertices))
    placed = butterfly_edge_vertices(vertices, topology)
    middle = vertices[topology.edges].mean(axis=1)
    on_side = (topology.edge_class == EdgeClass.BOUNDARY) & (np.abs(middle[:, 0]) == 1)
    # At a corner of the grid the curve turns, so the last edges are left out.
    on_side &= np.abs(middle[:, 1]) < 0.8
    assert on_side.sum() == 12
    expected = middle[on_side, 1] ** 3 - middle[on_side, 1]
    np.testing.assert_allclose(placed[on_side, 2], expected, atol=1e-14)


def test_affine_input_stays_in_its_plane_up_to_and_on_the_boundary():
    vertices, faces = grid(5, lambda x, y: 2 * x - y)
    placed = butterfly_edge_vertices(vertices, build_topology(faces, len(vertices)))
    np.testing.assert_allclose(placed[:, 2], 2 * placed[:, 0] - placed[:, 1], atol=1e-15)


def star(valence, height):
    """A fan round vertex 0, its rim of valence 6, so that one end alone is extraordinary."""
    angle = 2 * np.pi * np.arange(valence) / valence
    rim = np.stack([np.cos(angle), np.sin(angle), height(angle)], axis=1)
    wide = np.pi * np.arange(2 * valence) / valence
    outer = 2 * np.stack([np.cos(wide), np.sin(wide), np.zeros(2 * valence)], axis=1)
    j = np.arange(valence)
    inner, following = 1 + j, 1 + (j + 1) % valence
    first = 1 + valence
    opposite, between, after = first + 2 * j, first + 2 * j + 1, first + (2 * j + 2) % (2 * valence)
    faces = [(np.zeros_like(j), inner, following), (inner, opposite, between)]
    faces += [(inner, between, following), (following, between, after)]
    vertices = np.concatenate([np.zeros((1, 3)), rim, outer])
    return vertices, np.concatenate([np.stack(face, axis=1) for face in faces])


@pytest.mark.parametrize("valence", [3, 4, 5, 7, 8, 12])
def test_star_rule_has_the_eigenvalues_of_a_smooth_limit(valence):
    """Zorin's construction: first harmonics shrink by 1/2, second harmonics by 1/4."""
    for frequency, factor in ((1, 1 / 2), (2, 1 / 4)):
        if frequency == 2 and valence < 4:
            continue
        vertices, faces = star(valence, lambda angle, f=frequency: np.cos(f * angle))
        refined = refine(Mesh(vertices, faces), modified_butterfly(), 1, threads=1).mesh
        topology = build_topology(faces, len(vertices))
        spokes = np.flatnonzero(topology.edges[:, 0] == 0)
        new = refined.vertices[len(vertices) + spokes]
        rim = vertices[topology.edges[spokes, 1]]
        np.testing.assert_allclose(new[:, :2], rim[:, :2] / 2, atol=1e-14)
        np.testing.assert_allclose(new[:, 2], factor * rim[:, 2], atol=1e-14)


@pytest.mark.parametrize("valence", range(3, 13))
def test_star_weights_sum_to_a_quarter(valence):
    weights = [star_weights(np.array([valence]), turn)[0] for turn in range(valence)]
    assert sum(weights) == pytest.approx(1 / 4)


def test_edge_between_two_extraordinary_vertices_is_the_mean_of_both_stars():
    """The octahedron: every vertex has valence 4, every edge two stars."""
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]])
    faces = np.concatenate([faces, [[2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]])
    topology = build_topology(faces, 6)
    placed = butterfly_edge_vertices(vertices, topology)
    for point, (a, b) in zip(placed, vertices[topology.edges], strict=True):
        # From a: 3/4 a + 3/8 b − 1/8 (−b); from b the same with a and b exchanged.
        expected = ((3 / 4 * a + 1 / 2 * b) + (3 / 4 * b + 1 / 2 * a)) / 2
        np.testing.assert_allclose(point, expected, atol=1e-15)


def test_repeated_steps_converge_to_a_surface_through_the_mesh():
    vertices, faces = grid(7, bent)
    reports = refine(Mesh(vertices, faces), modified_butterfly(), levels=5, threads=1).report
    jumps = [level["normal_jump_max"] for level in reports["levels"]]
    assert jumps[-1] < jumps[0] / 3
