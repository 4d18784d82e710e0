import numpy as np
import pytest

from pns_common import Mesh, loop, refine
from pns_common.connectivity.topology import build_topology
from tests.support.meshes import bent, grid, icosphere
from train.baselines.butterfly import modified_butterfly
from train.baselines.curvature_adaptive import curvature_adaptive
from train.baselines.normal_displacement import fit_scalar, normal_displacement
from train.data.datasets import Dataset, Instance, ridge_training
from train.metrics.evaluation import one_step_table
from train.surfaces.implicit import SphereRidge


def test_on_an_icosahedron_the_scalar_that_reaches_the_sphere_is_the_missing_sagitta():
    vertices, faces = icosphere(0)
    edge = np.linalg.norm(vertices[1] - vertices[0])
    edge = np.sqrt(2 - 2 / np.sqrt(5)) if edge > 1.2 else edge
    sphere = SphereRidge(1.0, 0.0, 1.0, 0.0)
    data = Dataset("icosahedron", (Instance(sphere, Mesh(vertices, faces)),))
    # Loop's edge vertices all have one radius: its masks know the icosahedron's symmetry.
    smooth = refine(Mesh(vertices, faces), loop(), 1, threads=1).mesh.vertices[12:]
    radius = np.linalg.norm(smooth, axis=1)
    assert np.ptp(radius) < 1e-14
    assert fit_scalar(data) == pytest.approx((1 - radius[0]) / edge)
    pushed = refine(Mesh(vertices, faces), normal_displacement(fit_scalar(data)), 1, threads=1)
    np.testing.assert_allclose(np.linalg.norm(pushed.mesh.vertices[12:], axis=1), 1)


def test_the_fitted_scalar_is_better_than_its_neighbours():
    data = Dataset("few", ridge_training().instances[:4])
    scalar = fit_scalar(data)

    def square_sum(s):
        return (one_step_table(normal_displacement(s), data)["distance"] ** 2).sum()

    assert square_sum(scalar) < min(square_sum(scalar - 0.01), square_sum(scalar + 0.01))


def test_a_scalar_of_nothing_is_loop():
    mesh = Mesh(*grid(6, bent))
    np.testing.assert_array_equal(
        refine(mesh, normal_displacement(0.0), levels=2, threads=1).mesh.vertices,
        refine(mesh, loop(), levels=2, threads=1).mesh.vertices,
    )


@pytest.mark.parametrize(("sharpness", "limit"), [(0.0, loop()), (1e20, modified_butterfly())])
def test_the_blend_ends_at_loop_and_at_butterfly(sharpness, limit):
    vertices, faces = icosphere(1)
    rng = np.random.default_rng(0)
    mesh = Mesh(vertices * rng.uniform(0.8, 1.2, (len(vertices), 1)), faces)
    old = len(vertices)
    inserted = refine(mesh, curvature_adaptive(sharpness), 1, threads=1).mesh.vertices[old:]
    expected = refine(mesh, limit, 1, threads=1).mesh.vertices[old:]
    np.testing.assert_allclose(inserted, expected, atol=1e-12)


def test_the_blend_lies_between_loop_and_butterfly():
    vertices, faces = grid(6, bent)
    mesh, old = Mesh(vertices, faces), len(vertices)
    topology = build_topology(faces, old)
    interior = old + topology.interior
    blend = refine(mesh, curvature_adaptive(10.0), 1, threads=1)
    low = refine(mesh, loop(), 1, threads=1).mesh.vertices[interior]
    high = refine(mesh, modified_butterfly(), 1, threads=1).mesh.vertices[interior]
    share = blend.gate[interior]
    assert share.max() > 0.5
    expected = low + share[:, None] * (high - low)
    np.testing.assert_allclose(blend.mesh.vertices[interior], expected, atol=1e-14)
