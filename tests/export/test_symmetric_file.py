"""A symmetric network as a model file: the average is inside, and no numbering is in the result."""

from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch

from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, check_parity
from pns_common import Mesh, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.models.contract import ALLOWED_OPERATORS
from pns_common.runtimes.onnx_model import model_from_bytes
from tests.support.meshes import bent, bumpy_sphere, grid
from tests.support.renumbering import ASSETS, MIRROR, asset, mirrored, renumbered, turned_over
from train.certificates.equivariance import well_conditioned
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model

BUDGET = 0.5
SINGLE = 1e-6
SIGNED = sorted(
    name for name, features in FEATURE_SETS.items() if len(features.symmetries.order) == 8
)
feature_sets = pytest.mark.parametrize("features", sorted(FEATURE_SETS))


def network_and_file(features, scale=3.0):
    recipe = replace(paper(), features=features, orientation="symmetric")
    network = initial_network(recipe)
    with torch.no_grad():
        network.linear_layers[-1].weight *= scale
    return network, model_bytes(network, recipe_model(recipe, network).card)


@feature_sets
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_file_says_what_the_network_says(features, scale):
    network, data = network_and_file(features, scale)
    parity = check_parity(model_from_bytes(data, "test"), network)
    assert parity.difference <= TOLERANCE
    assert parity.length <= 1 + TOLERANCE


@feature_sets
def test_same_network_same_bytes_and_only_listed_operators(features):
    _, data = network_and_file(features)
    assert data == network_and_file(features)[1]
    operators = {node.op_type for node in onnx.load_from_string(data).graph.node}
    assert operators <= ALLOWED_OPERATORS
    assert model_from_bytes(data, "test").card.orientation == "symmetric"


@feature_sets
@pytest.mark.parametrize("name", ["sphere", "patch", *ASSETS])
def test_numbering_and_mirrors_change_nothing_through_a_file(features, name):
    shapes = {"sphere": bumpy_sphere, "patch": lambda: grid(7, bent)}
    mesh = Mesh(*shapes[name]()) if name in shapes else asset(name)
    scheme = pns(model_from_bytes(network_and_file(features)[1], "test"), BUDGET)
    still = refine(mesh, scheme, 1, reference_length=1.0).mesh.vertices
    twins = [(renumbered(mesh, 0), still), (mirrored(mesh), still * MIRROR)]
    if features in SIGNED:
        twins.append((turned_over(mesh), still))
    edges = build_topology(mesh.faces, len(mesh.vertices)).edges
    square = np.sum((mesh.vertices[edges[:, 1]] - mesh.vertices[edges[:, 0]]) ** 2, axis=1)
    allowed = 1e-12 + SINGLE * BUDGET * np.concatenate([np.zeros(len(mesh.vertices)), square])
    kept = np.concatenate([np.ones(len(mesh.vertices), dtype=bool), well_conditioned(mesh)])
    for twin, expected in twins:
        positions = refine(twin.mesh, scheme, 1, reference_length=1.0).mesh.vertices[twin.place]
        assert (np.linalg.norm(positions - expected, axis=1) <= allowed)[kept].all()
