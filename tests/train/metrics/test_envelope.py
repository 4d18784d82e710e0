import numpy as np
import pytest

from pns_common import refine
from pns_common.schemes import pns
from tests.support.networks import random_model
from train.data.datasets import Dataset, ridge_held_out, saddle_held_out
from train.metrics.envelope import best_in_balls, envelope_limit, oracle
from train.metrics.evaluation import one_step_table
from train.surfaces.implicit import SphereRidge, signed_distance

SPHERE = SphereRidge(1.0, 0.0, 1.0, 0.0)


def test_the_limit_of_the_held_out_ridges_is_the_published_one():
    improvements = envelope_limit(ridge_held_out(), budget=0.5, gate_sharpness=10.0)
    percent = [improvements[name].percent for name in ("distance_near", "distance", "hausdorff")]
    np.testing.assert_allclose(percent, (23.3, 19.2, 9.35), atol=0.05)


def test_a_ball_that_the_surface_crosses_loses_all_of_its_distance():
    centres = np.array([[1.2, 0, 0], [0, 0.9, 0]])
    best = best_in_balls(SPHERE, centres, np.array([0.3, 0.2]))
    assert np.abs(signed_distance(SPHERE, best)).max() < 1e-8


def test_a_ball_beside_a_sphere_loses_its_radius():
    centres = np.array([[1.5, 0, 0], [0, 0, 0.5], [0, -2, 0]])
    radii = np.array([0.1, 0.2, 0.3])
    best = best_in_balls(SPHERE, centres, radii)
    expected = np.abs(np.linalg.norm(centres, axis=1) - 1) - radii
    np.testing.assert_allclose(np.abs(signed_distance(SPHERE, best)), expected, atol=1e-8)
    assert (np.linalg.norm(best - centres, axis=1) <= radii * (1 + 1e-12)).all()


def test_a_ball_without_size_stays_where_it_is():
    centres = np.array([[1.5, 0.2, -0.3]])
    np.testing.assert_array_equal(best_in_balls(SPHERE, centres, np.zeros(1)), centres)


def test_the_oracle_keeps_to_the_envelope():
    instance = ridge_held_out().instances[8]
    scheme = oracle(instance.surface, budget=0.5, gate_sharpness=10.0)
    refined = refine(instance.mesh, scheme, 1, reference_length=1.0)
    assert (refined.ratio <= refined.gate + 1e-12).all()
    assert refined.ratio.max() > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_no_network_does_better_at_any_vertex(seed):
    data = Dataset("few", saddle_held_out().instances[:1] + ridge_held_out().instances[8:9])
    limit = one_step_table(lambda instance: oracle(instance.surface, 0.5, 10.0), data)
    reached = one_step_table(pns(random_model(seed, scale=5.0), budget=0.5), data)
    for metric in ("distance", "hausdorff"):
        assert (reached[metric] >= limit[metric]).all()
