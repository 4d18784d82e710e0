from dataclasses import replace

import numpy as np
import pytest
import torch
from pns_common.connectivity.topology import build_topology

from pns_common.schemes import Placement, Scheme, loop_edge_rule, loop_vertex_rule, pns
from tests.support.networks import published_model
from tests.support.shared import published
from train.data.datasets import ridge_held_out, saddle_held_out, sphere_ridge_held_out
from train.metrics.evaluation import compare_with_loop, one_step_table
from train.metrics.one_step import (
    METRICS,
    fan_normal,
    improvement,
    improvements_as_data,
    normal_error,
    one_step_errors,
)
from train.surfaces.implicit import SphereRidge

# The printed columns of the published table: near-feature and global distance, near-feature and
# global Hausdorff, near-feature and global normal error, in per cent.
PUBLISHED_PNS = (21.01, 13.29, 9.25, 9.25, 0.42, 0.07)
PUBLISHED_UNCONSTRAINED = (56.21, 54.34, 49.83, 49.83, 38.80, -4.16)
PUBLISHED_PNS_INTERVAL = {"distance_near": (13.67, 31.02), "hausdorff": (1.88, 21.19)}
PUBLISHED_LOOP_MEANS = (0.033072, 0.022010, 0.059961, 0.059961, 0.123859, 0.063560)
POINTS = 0.02


def percents(improvements):
    return [improvements[metric].percent for metric in METRICS]


def test_published_weights_give_the_published_table():
    model = published_model(published("weights.npz"), "pns_headline_C0.5")
    improvements = compare_with_loop(pns(model, budget=0.5), ridge_held_out())
    np.testing.assert_allclose(percents(improvements), PUBLISHED_PNS, rtol=0, atol=POINTS)
    means = [improvements[metric].reference_mean for metric in METRICS]
    np.testing.assert_allclose(means, PUBLISHED_LOOP_MEANS, rtol=0, atol=2e-6)
    for metric, interval in PUBLISHED_PNS_INTERVAL.items():
        row = improvements[metric]
        np.testing.assert_allclose((row.low, row.high), interval, rtol=0, atol=POINTS)


def test_published_unconstrained_network_gives_its_published_column():
    weights = published("weights.npz")
    improvements = compare_with_loop(unconstrained_scheme(weights), ridge_held_out())
    np.testing.assert_allclose(percents(improvements), PUBLISHED_UNCONSTRAINED, rtol=0, atol=POINTS)


def test_published_saddle_network_gains_nothing():
    model = published_model(published("weights.npz"), "pns_saddle")
    improvements = compare_with_loop(pns(model, budget=0.5), saddle_held_out())
    assert improvements["distance_near"].reference_mean == pytest.approx(1.792123e-4, abs=1e-8)
    assert improvements["distance_near"].percent == pytest.approx(0.0215, abs=POINTS)
    assert improvements["distance"].percent == pytest.approx(0.0188, abs=POINTS)


def unconstrained_scheme(weights):
    """Raw coordinates of a, b, c, d in, an offset from Loop's edge vertex out."""
    network = torch.nn.Sequential(
        *(
            module
            for width in (12, 32, 32)
            for module in (torch.nn.Linear(width, 32), torch.nn.GELU())
        ),
        torch.nn.Linear(32, 3),
    )
    prefix = "unconstrained_foil/net."
    network.load_state_dict(
        {
            key.removeprefix(prefix): torch.tensor(weights[key])
            for key in weights
            if key.startswith(prefix)
        }
    )

    def edge_rule(level):
        base, interior = loop_edge_rule(level), level.topology.interior
        corners = level.points[level.topology.stencil[interior]].reshape(-1, 12)
        offsets = np.zeros_like(base.loop)
        with torch.no_grad():
            offsets[interior] = network(torch.from_numpy(corners).float()).numpy()
        return Placement(base.loop, offsets, base.ratio, base.gate, base.degenerate)

    return Scheme("unconstrained", loop_vertex_rule, edge_rule)


def test_points_on_a_sphere_have_no_distance_error():
    sphere = SphereRidge(1.0, 0.0, 1.0, 0.0)
    mesh = sphere_ridge_held_out().instances[0].mesh
    topology = build_topology(mesh.faces, len(mesh.vertices))
    inserted = mesh.vertices[topology.edges[topology.interior]].mean(axis=1)
    inserted /= np.linalg.norm(inserted, axis=1, keepdims=True)
    errors = one_step_errors(sphere, mesh.vertices, topology, inserted)
    assert errors.distance < 1e-15
    assert errors.hausdorff < 1e-15
    shifted = one_step_errors(sphere, mesh.vertices, topology, 1.25 * inserted)
    assert shifted.distance == pytest.approx(0.25)
    assert shifted.hausdorff == pytest.approx(0.25)


def test_near_errors_are_absent_without_a_near_vertex():
    instance = ridge_held_out().instances[0]
    mesh = instance.mesh
    topology = build_topology(mesh.faces, len(mesh.vertices))
    inserted = mesh.vertices[topology.edges[topology.interior]].mean(axis=1)
    far_away = replace(instance.surface, centre_x=50.0)
    errors = one_step_errors(far_away, mesh.vertices, topology, inserted)
    assert np.isnan([errors.distance_near, errors.hausdorff_near, errors.normal_near]).all()
    assert errors.distance > 0


def two_triangles():
    """Edge (0, 1) with c = 2 on its left and d = 3 on its right, in space."""
    coarse = np.array([[0, 0, 0], [1, 0, 0.2], [0.4, 0.9, 0.3], [0.6, -0.8, 0.1]])
    return coarse, build_topology(np.array([[0, 1, 2], [1, 0, 3]]), 4)


def test_fan_normal_does_not_depend_on_an_inserted_vertex_that_folds_nothing():
    coarse, topology = two_triangles()
    a, b, c, d = coarse
    expected = np.cross(b - a, c - d)
    for offset in (0.0, 0.05, -0.05):
        inserted = np.array([[0.5, 0.0, 0.1 + offset]])
        normal = fan_normal(coarse, topology, inserted)
        np.testing.assert_allclose(normal, expected[None], rtol=0, atol=1e-15)


def test_fan_normal_turns_a_folded_triangle_back():
    coarse, topology = two_triangles()
    a, b, c, d = coarse
    inserted = np.array([[-0.5, 0.6, 0.1]])
    q = inserted[0]
    n1, n2 = np.cross(b - a, c - a), np.cross(a - b, d - b)
    sides = [(a, c, n1), (c, b, n1), (b, d, n2), (d, a, n2)]
    areas = [np.cross(u - q, v - q) for u, v, _ in sides]
    turned = [area * np.sign(area @ n) for area, (_, _, n) in zip(areas, sides, strict=True)]
    assert np.abs(sum(turned)).sum() > np.abs(sum(areas)).sum() + 0.1
    # The four run a → c → b → d round q: against the faces, so that all are turned.
    np.testing.assert_allclose(fan_normal(coarse, topology, inserted)[0], sum(turned), atol=1e-15)


def test_normal_error_of_a_flat_fan_against_a_sphere_is_its_angle():
    coarse = np.array([[0.0, 0, 1], [1, 0, 1], [0.5, 1, 1], [0.5, -1, 1]])
    topology = build_topology(np.array([[0, 1, 2], [1, 0, 3]]), 4)
    inserted = np.array([[0.5, 0.0, 1.0]])
    sphere = SphereRidge(1.0, 0.0, 1.0, 0.0)
    angle = normal_error(sphere, coarse, topology, inserted)
    np.testing.assert_allclose(angle, np.arctan(0.5), atol=1e-12)


def test_bootstrap_is_the_one_written_out():
    rng = np.random.default_rng(8)
    reference, method = rng.uniform(1, 2, size=7), rng.uniform(0.5, 1.5, size=7)
    resampler = np.random.default_rng(0)
    resamples = []
    for _ in range(2000):
        drawn = resampler.integers(0, 7, size=7)
        resamples.append(100 * (1 - method[drawn].mean() / reference[drawn].mean()))
    gain = improvement(reference, method)
    assert gain.percent == pytest.approx(np.mean(resamples), abs=1e-12)
    assert gain.low == pytest.approx(np.quantile(resamples, 0.025), abs=1e-12)
    assert gain.high == pytest.approx(np.quantile(resamples, 0.975), abs=1e-12)
    assert (gain.reference_mean, gain.method_mean) == (reference.mean(), method.mean())


def test_a_constant_ratio_has_an_interval_of_no_width():
    reference = np.array([1.0, 2.0, 5.0])
    gain = improvement(reference, 0.75 * reference)
    np.testing.assert_allclose([gain.percent, gain.low, gain.high], 25, rtol=1e-12)
    assert improvements_as_data({"distance": gain})["distance"]["percent"] == 25


def test_loop_against_itself_gains_nothing():
    scheme = Scheme("loop", loop_vertex_rule, loop_edge_rule)
    improvements = compare_with_loop(scheme, ridge_held_out())
    assert percents(improvements) == [0] * len(METRICS)
    assert {len(column) for column in one_step_table(scheme, ridge_held_out()).values()} == {10}
