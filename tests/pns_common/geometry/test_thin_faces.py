"""Beside thin faces the network speaks in altitudes, and short edges may go where long ones go."""

import numpy as np
import pytest
from hypothesis import given

from pns_common import Mesh, load_model, loop, pns, refine
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.geometry.frames import face_normals
from pns_common.geometry.rings import Rings
from pns_common.geometry.thin_faces import network_lengths
from tests.support.meshes import icosphere, manifolds, proper_faces, soups, torus_of_quads
from tests.support.networks import scale_free_model
from tests.support.quasi_interpolation import quasi_interpolated, with_card
from train.metrics.fairness import bending

ALTITUDES = 1.3
OF_LONG_EDGES = {"network_altitudes": None, "wide_bound": None}


@given(manifolds() | soups())
def test_lengths_are_those_of_their_definition(mesh):
    """h ℓ_e = min(h², α h a), less where both faces are thin; areas from another corner."""
    mesh = proper_faces(mesh)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals = face_normals(mesh.vertices, mesh.faces)
    lengths = network_lengths(Rings(topology, mesh.vertices, normals), ALTITUDES)
    rounding = 1e-13 * np.abs(mesh.vertices).max() ** 2
    for number, edge in enumerate(topology.edges):
        length = np.linalg.norm(np.subtract(*mesh.vertices[edge]))
        expected = length**2
        if topology.edge_class[number] == EdgeClass.INTERIOR:
            sides = mesh.vertices[mesh.faces[np.isin(mesh.faces, edge).sum(axis=1) == 2]]
            areas = np.linalg.norm(
                np.cross(sides[:, 2] - sides[:, 1], sides[:, 0] - sides[:, 1]), axis=1
            )
            longest = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=-1).max(axis=1)
            shape = (areas / longest**2).max()
            expected = min(expected, ALTITUDES * areas.min()) * min(1, 3 * ALTITUDES * shape) ** 2
        assert length * lengths.at_edges[number] == pytest.approx(expected, rel=1e-12, abs=rounding)
    for vertex in range(len(mesh.vertices)):
        around = lengths.at_edges[np.nonzero(topology.edges == vertex)[0]]
        mean = np.sqrt(np.mean(around**2)) if len(around) else 0.0
        assert lengths.at_vertices[vertex, 0] == pytest.approx(mean, rel=1e-12)


def test_on_faces_as_wide_as_long_nothing_changes():
    mesh = Mesh(*icosphere(2))
    narrow = scale_free_model(5)
    wide = with_card(narrow, network_altitudes=3.0, wide_bound=True)
    ours, theirs = (refine(mesh, pns(model), 2) for model in (wide, narrow))
    np.testing.assert_array_equal(ours.mesh.vertices, theirs.mesh.vertices)
    # The bound's h is the longest edge around, so the same step is a smaller part of it.
    assert (ours.ratio <= theirs.ratio).all()


@pytest.mark.parametrize(("around", "across"), [(16, 160), (12, 200)])
def test_a_torus_of_thin_faces_stays_as_smooth_as_loops(around, across):
    """Faces up to 30 times as long as wide, all along or all across the greater bend.

    By h alone the default model's largest turn is several times Loop's.
    """
    mesh = Mesh(*torus_of_quads(around, across))
    assert largest_turn(mesh, load_model()) < 1.1
    assert largest_turn(mesh, with_card(load_model(), **OF_LONG_EDGES)) > 2


def test_on_thin_faces_neither_the_altitudes_nor_the_bound_suffice_alone():
    """The numbers of docs/theorems.md, 9."""
    mesh, model = Mesh(*torus_of_quads(16, 160)), load_model()
    by_bound_alone = with_card(model, network_altitudes=None)
    turns = [
        largest_turn(mesh, given) for given in (with_card(model, **OF_LONG_EDGES), by_bound_alone)
    ]
    assert np.round(turns, 1).tolist() == [6.4, 2.5]
    assert largest_turn(mesh, with_card(model, wide_bound=None)) > 6


@pytest.mark.parametrize("mesh", [torus_of_quads(6, 64), torus_of_quads(16, 160)])
def test_rows_of_thin_faces_have_no_ripples(mesh):
    """With answers in units of altitudes alone they bend four times as much as Loop's."""
    ours, theirs = (refine(Mesh(*mesh), scheme, 2).mesh for scheme in (pns(load_model()), loop()))
    assert bending(ours) < 1.15 * bending(theirs)


@pytest.mark.parametrize(("wide", "share"), [(2.0, 1.0), (0.5, 0.5625)])
def test_beside_one_thin_face_all_that_its_altitudes_allow_is_asked_for(wide, share):
    """Two faces share a side of 4 units, one of them half a unit wide: less if both are thin."""
    points = np.array([[0, 0, 0], [4, 0, 0], [2, wide, 0], [2, 0, 0.5]])
    topology = build_topology(np.array([[0, 1, 2], [1, 0, 3]]), 4)
    rings = Rings(topology, points, face_normals(points, topology.faces))
    assert network_lengths(rings, 2.0).at_edges[topology.interior[0]] == share


def test_a_wide_bound_leaves_quasi_interpolation_whole_on_thin_faces():
    """Short edges go where the long ones beside them go, also where C h² / R of theirs is less."""
    points, faces = torus_of_quads(16, 200)
    expected = quasi_interpolated(points, faces)
    prior = with_card(
        scale_free_model(0, 0.0), side_gates=True, gate_sharpness=1e12, vertex_gate_sharpness=1e9
    )
    off = {}
    for wide in (True, False):
        made = refine(Mesh(points, faces), pns(with_card(prior, wide_bound=wide)))
        off[wide] = np.abs(made.mesh.vertices - expected).max()
    assert off[True] < 1e-12
    assert off[False] > 1e-3


def largest_turn(mesh, model):
    """Between neighbouring children, over Loop's."""
    ours, theirs = (refine(mesh, scheme) for scheme in (pns(model), loop()))
    return (
        ours.report["levels"][-1]["normal_jump_max"]
        / theirs.report["levels"][-1]["normal_jump_max"]
    )
