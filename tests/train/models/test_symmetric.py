"""With the symmetric orientation no numbering is part of the result, and mirrors stay mirrors."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.orientation import FIRST_FACE, SYMMETRIC
from pns_common.geometry.frames import edge_stencil, face_normals, shut_where_degenerate
from pns_common.geometry.rings import Rings
from tests.support.meshes import TETRAHEDRON, bumpy_sphere, manifolds, soups
from tests.support.renumbering import ASSETS, MIRROR, asset, mirrored, renumbered, turned_over
from train.certificates.equivariance import well_conditioned
from train.models.from_recipe import initial_network
from train.models.networks import BoundedNet
from train.models.recipes import paper
from train.models.torch_model import recipe_model

EXACT = 1e-12
SIGNED = sorted(
    name for name, features in FEATURE_SETS.items() if len(features.symmetries.order) == 8
)


def model(features="paper-5", orientation="symmetric", seed=0):
    """A double precision model with loud random weights."""
    recipe = replace(paper(seed), features=features, orientation=orientation)
    network = initial_network(recipe).double()
    with torch.no_grad():
        for layer in network.linear_layers:
            layer.weight *= 3
    return recipe_model(recipe, network)


def apart(mesh, twin, subject, expected=lambda positions: positions):
    """How far the twin's refined vertices are from where they should be, where well defined."""
    positions = refine(twin.mesh, pns(subject), 1, reference_length=1.0).mesh.vertices[twin.place]
    wanted = expected(refine(mesh, pns(subject), 1, reference_length=1.0).mesh.vertices)
    kept = np.ones(len(positions), dtype=bool)
    kept[len(mesh.vertices) :] = well_conditioned(mesh)
    return np.linalg.norm(positions - wanted, axis=1)[kept].max(initial=0)


def reflected(positions):
    return positions * MIRROR


feature_sets = pytest.mark.parametrize("features", sorted(FEATURE_SETS))


@feature_sets
@pytest.mark.parametrize("name", ASSETS)
def test_numbering_and_mirrors_change_nothing_on_assets(features, name):
    mesh, subject = asset(name), model(features)
    assert apart(mesh, renumbered(mesh, 0), subject) < EXACT
    assert apart(mesh, mirrored(mesh), subject, reflected) < EXACT
    if features in SIGNED:
        assert apart(mesh, turned_over(mesh), subject) < EXACT


@feature_sets
@given(mesh=manifolds(), seed=st.integers(0, 2**31))
def test_relabelling_permutes_the_output(features, mesh, seed):
    assert apart(mesh, renumbered(mesh, seed), model(features)) < EXACT


@feature_sets
@given(mesh=manifolds())
def test_a_mirrored_mesh_gives_the_mirrored_result(features, mesh):
    assert apart(mesh, mirrored(mesh), model(features), reflected) < EXACT


@pytest.mark.parametrize("features", SIGNED)
@given(mesh=manifolds())
def test_turning_all_faces_over_changes_no_position(features, mesh):
    assert apart(mesh, turned_over(mesh), model(features)) < EXACT


def test_the_papers_orientation_promises_none_of_this():
    mesh, subject = Mesh(*bumpy_sphere()), model(orientation="first-face")
    assert apart(mesh, renumbered(mesh, 0), subject) > 1e-4
    assert apart(mesh, mirrored(mesh), subject, reflected) > 1e-4


def test_unsigned_features_cannot_tell_outside_from_inside():
    """Their group has no turn-over: with it every correction along N would average away."""
    mesh, subject = Mesh(*bumpy_sphere()), model("paper-5")
    assert apart(mesh, turned_over(mesh), subject) > 1e-4


@given(soups() | manifolds())
def test_c_is_left_of_the_edge(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    left = SYMMETRIC.order(topology, topology.interior)
    first = FIRST_FACE.order(topology, topology.interior)
    for (a, b, c, d), (left_face, right_face) in zip(
        left.stencil.tolist(), left.faces.tolist(), strict=True
    ):
        assert [a, b, c] in [np.roll(mesh.faces[left_face], i).tolist() for i in range(3)]
        assert [b, a, d] in [np.roll(mesh.faces[right_face], i).tolist() for i in range(3)]
    np.testing.assert_array_equal(np.sort(left.faces, axis=1), np.sort(first.faces, axis=1))


@feature_sets
@given(mesh=soups())
def test_degenerate_edges_are_left_alone_and_their_features_finite(features, mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    ordered = SYMMETRIC.order(topology, topology.interior)
    fields = FEATURE_SETS[features].fields(
        Rings(topology, mesh.vertices, face_normals(mesh.vertices, mesh.faces))
    )
    normals = face_normals(mesh.vertices, mesh.faces)
    stencil = edge_stencil(mesh.vertices, normals, ordered.stencil, ordered.faces, fields)
    frames = shut_where_degenerate(stencil)
    assert (frames.curvature[frames.degenerate] == 0).all()
    assert np.isfinite(FEATURE_SETS[features](stencil, frames)).all()
    refined = refine(mesh, pns(model(features)), 1)
    assert (refined.ratio[len(mesh.vertices) + topology.interior[frames.degenerate]] == 0).all()
    assert refined.ratio.max() <= 1 + EXACT


def test_a_folded_pair_of_faces_is_degenerate_in_both_orientations():
    folded = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0.3, 1, 0], [0.4, 1, 0]]), TETRAHEDRON[:2])
    for orientation, moved in (("first-face", True), ("symmetric", False)):
        refined = refine(folded, pns(model(orientation=orientation)), 1)
        assert refined.report["levels"][0]["degenerate_frames"] == 1
        assert (refined.ratio.max() > 0) == moved


@feature_sets
def test_the_network_answers_every_reading_of_an_edge_alike(features):
    group = FEATURE_SETS[features].symmetries
    network = model(features).network
    rows = torch.from_numpy(
        np.random.default_rng(0).normal(size=(50, network.group.order.shape[1]))
    )
    with torch.no_grad():
        plain = network(rows, 0.5)
        for order, signs, local in zip(group.order, group.signs, group.local, strict=True):
            turned = network(rows[:, order] * torch.from_numpy(signs), 0.5)
            expected = plain * torch.from_numpy(local)
            torch.testing.assert_close(turned, expected, rtol=0, atol=1e-14)
    assert torch.linalg.vector_norm(plain, dim=1).max() <= 0.5 * (1 + EXACT)
    assert torch.linalg.vector_norm(plain, dim=1).max() > 0.1


def test_weights_of_both_kinds_of_network_are_the_same():
    """Averaging adds nothing to a checkpoint."""
    keys = initial_network(replace(paper(), orientation="symmetric")).state_dict().keys()
    assert keys == initial_network(paper()).state_dict().keys()
    assert isinstance(model().network, BoundedNet)
