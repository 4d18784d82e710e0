"""The operator against its author's published intermediates and refined meshes."""

import numpy as np
import pytest

from pns_common import Mesh, loop, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import paper_features
from pns_common.formula.correction import correct, curvature_gate
from pns_common.geometry.frames import edge_frames, edge_stencil, face_normals
from pns_common.masks.stencils import loop_edge_point
from tests.support.networks import (
    PUBLISHED_BUDGET,
    PUBLISHED_GATE_SHARPNESS,
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
def sphere(steps):
    mesh = Mesh(steps["bumpy_sphere/vertices"], steps["bumpy_sphere/faces"])
    topology = build_topology(mesh.faces, len(mesh.vertices))
    # The author lists the edges in another order.
    position = {tuple(edge): e for e, edge in enumerate(topology.edges.tolist())}
    order = np.array([position[tuple(edge)] for edge in steps["bumpy_sphere/edges"].tolist()])
    normals = face_normals(mesh.vertices, mesh.faces)
    stencil = edge_stencil(
        mesh.vertices, normals, topology.stencil[order], topology.edge_faces[order]
    )
    return topology, order, stencil


def test_edges_faces_and_opposites_are_the_published_ones(steps, sphere):
    topology, order, _ = sphere
    np.testing.assert_array_equal(topology.edges[order], steps["bumpy_sphere/edges"])
    np.testing.assert_array_equal(topology.edge_faces[order], steps["bumpy_sphere/edge_faces"])
    np.testing.assert_array_equal(topology.stencil[order, 2:], steps["bumpy_sphere/opposites"])


def test_every_intermediate_equals_the_published_one(steps, weights, sphere):
    _, _, stencil = sphere
    network = float64_network(published_layers(weights, "pns_headline_C0.5"))
    gate = curvature_gate(PUBLISHED_GATE_SHARPNESS)
    frames = edge_frames(stencil)
    phi = paper_features(stencil, frames)
    correction = correct(stencil, paper_features, network, gate, PUBLISHED_BUDGET)
    q0 = loop_edge_point(stencil.a, stencil.b, stencil.c, stencil.d)
    columns = np.stack([frames.tangent, frames.normal, frames.binormal], axis=-1)
    own = {
        "frames": columns,
        "e_len": frames.length,
        "phi": phi,
        "gate": correction.gate,
        "eta": PUBLISHED_BUDGET * network(phi),
        "q0": q0,
        "q": q0 + correction.displacement,
    }
    for name, value in own.items():
        np.testing.assert_allclose(
            value, steps[f"bumpy_sphere/{name}"], rtol=0, atol=1e-10, err_msg=name
        )


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
