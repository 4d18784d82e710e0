"""The operator against its author's published intermediates and refined meshes."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, loop, pns
from pns_common.operator.formula import edge_inputs
from pns_common.refinement import control_level
from tests.support.control_points import refine
from tests.support.networks import (
    PUBLISHED_BUDGET,
    float64_network,
    published_layers,
    published_model,
)
from tests.support.shared import published


@pytest.fixture(scope="module")
def steps():
    return published("operator_steps.npz")


@pytest.fixture(scope="module")
def weights():
    return published("weights.npz")


@pytest.fixture(scope="module")
def sphere(steps, weights):
    """The published mesh's level, its rule, and the author's edges among ours."""
    mesh = Mesh(steps["bumpy_sphere/vertices"], steps["bumpy_sphere/faces"])
    scheme = pns(published_model(weights, "pns_headline_C0.5"))
    level = control_level(mesh, scheme, 1.0)
    position = {tuple(edge): e for e, edge in enumerate(level.topology.edges.tolist())}
    order = np.array([position[tuple(edge)] for edge in steps["bumpy_sphere/edges"].tolist()])
    return level, replace(scheme.rule, feature_type=np.float64), order


def test_edges_and_their_faces_are_the_published_ones(steps, sphere):
    level, _, order = sphere
    np.testing.assert_array_equal(level.topology.edges[order], steps["bumpy_sphere/edges"])
    faces = np.sort(level.topology.half_edges[order] // 3, axis=1)
    np.testing.assert_array_equal(faces, np.sort(steps["bumpy_sphere/edge_faces"], axis=1))


def test_every_intermediate_equals_the_published_one(steps, weights, sphere):
    level, rule, order = sphere
    at = edge_inputs(level, rule, order.astype(np.uint32))
    network = float64_network(published_layers(weights, "pns_headline_C0.5"))
    frames = at.basis.reshape(-1, 3, 3)
    eta, length = network(at.features), level.edges.lengths[order]
    q0 = level.base.place(level.points, level.topology, level.blocks)[len(level.points) + order]
    turned = np.einsum("ej,ejk->ek", eta, frames)
    own = {
        "frames": np.swapaxes(frames, 1, 2),
        "e_len": length,
        "phi": at.features,
        "gate": at.gate,
        "eta": PUBLISHED_BUDGET * eta,
        "q0": q0,
        "q": q0 + (at.bound * at.gate)[:, None] * turned,
    }
    for name, value in own.items():
        expected = steps[f"bumpy_sphere/{name}"]
        np.testing.assert_allclose(value, expected, rtol=0, atol=1e-10, err_msg=name)


@pytest.mark.parametrize("instance", ["ridge_test_0", "ridge_test_3"])
@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize("scheme", ["loop", "pns"])
def test_refined_ridges_equal_the_published_ones(steps, weights, instance, level, scheme):
    data = published("datasets.npz")
    vertices, faces = ridge(data, int(instance.removeprefix("ridge_test_")))
    rule = loop() if scheme == "loop" else pns(published_model(weights, "pns_headline_C0.5"))
    refined = refine(Mesh(vertices, faces), rule, level, reference_length=1)
    np.testing.assert_array_equal(refined.mesh.faces, steps[f"{instance}/faces_{level}"])
    np.testing.assert_allclose(
        refined.mesh.vertices, steps[f"{instance}/{scheme}_{level}"], rtol=0, atol=2e-6
    )


def ridge(data, index):
    return data["ridge_test_vertices"][index], data["ridge_test_faces"]
