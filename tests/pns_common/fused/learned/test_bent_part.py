"""Where a mesh bends alone the rules are evaluated, and the whole gets what it would have got."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, load_model, pns, refine
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES
from pns_common.fused.learned import bent_part as module
from pns_common.fused.learned.bent_part import bent_part
from pns_common.fused.learned.curves import NO_RULE
from pns_common.fused.learned.learned_step import learned_points
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.level import control_level
from tests.support.kernels import assert_kernels_agree, by_arrays, by_kernels, edges_of
from tests.support.meshes import grid
from tests.support.networks import scale_free_model

SCHEMES = {
    "bundled": pns(load_model()),
    "side gates": pns(scale_free_model(side_gates=True, boundary_strength=1.0)),
    "all of it, guarded hard": pns(
        scale_free_model(
            *(0,),
            side_gates=True,
            boundary_strength=1.0,
            crease_prior=True,
            tip_strength=1.0,
            network_altitudes=2.0,
            wide_bound=True,
            fold_angle=2.0,
        )
    ),
    "two learned levels": pns(scale_free_model(boundary_strength=1.0, learned_levels=2)),
    "without a rule for boundaries": pns(scale_free_model()),
}


@pytest.fixture(autouse=True)
def always_cut(monkeypatch):
    monkeypatch.setattr(module, "LEAST_FACES", 0)
    monkeypatch.setattr(module, "MOST_BENT", 2.0)
    monkeypatch.setattr(module, "LARGEST_PART", 2.0)


@st.composite
def sheets(draw):
    """Planes with bumps and pits, holes, doubled faces and faces that join what is far apart."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    n = draw(st.integers(6, 16))
    points, faces = grid(n)
    for _ in range(draw(st.integers(0, 3))):
        centre, radius = rng.uniform(-1, 1, 2), rng.uniform(0.1, 0.5)
        away = np.hypot(*(points[:, :2] - centre).T) / radius
        points[:, 2] += np.where(away < 1, rng.uniform(-0.4, 0.4) * (1 - away**2), 0)
    faces = faces[rng.random(len(faces)) >= draw(st.sampled_from([0, 0.05]))]
    if draw(st.booleans()):
        twice = faces[rng.integers(0, len(faces), 3)]
        faces = np.concatenate([faces, twice, rng.integers(0, len(points), (3, 3))])
    if draw(st.booleans()):
        order = rng.permutation(len(points))
        points, faces = points[np.argsort(order)], order[faces][rng.permutation(len(faces))]
    # −0 is another number of bits.
    points[:, 2] = np.where(points[:, 2] == 0, draw(st.sampled_from([0.0, -0.0])), points[:, 2])
    return Mesh(points, faces)


@given(sheets(), st.sampled_from(list(SCHEMES)), st.integers(1, 2), st.integers(0, 3))
def test_meshes_that_bend_here_and_there_are_the_array_kernels(mesh, scheme, levels, creases):
    named = edges_of(mesh, creases, 0) if creases else None
    assert_kernels_agree(mesh, levels, named, SCHEMES[scheme], length=0.7)


@given(sheets(), st.integers(1, 3), st.integers(5, 200))
def test_threads_and_blocks_change_nothing(mesh, threads, rows):
    scheme = SCHEMES["bundled"]
    made = by_kernels(mesh, 1, scheme=scheme, threads=threads, rows=rows)
    assert made.points.tobytes() == by_arrays(mesh, 1, scheme=scheme).points.tobytes()


@given(sheets())
def test_each_vertex_may_have_its_own_unit_of_length(mesh):
    scheme, count = SCHEMES["side gates"], len(mesh.vertices)
    level = control_level(mesh.vertices, mesh.faces, NO_CREASES, Blocks(1))
    made = learned_points(level, scheme, 0.7, Blocks(1))
    of_each = learned_points(level, scheme, np.full(count, 0.7), Blocks(1))
    assert made.points.tobytes() == of_each.points.tobytes()


def surroundings(mesh):
    level = control_level(mesh.vertices, mesh.faces, NO_CREASES, Blocks(1))
    of_level = level.points, level.mesh, level.faces, level.multi_fan_vertices
    return Surroundings(*of_level, 1.0, Blocks(1), NO_RULE)


def hill(n=40):
    """A hill on a hundredth of a plane."""
    points, faces = grid(n)
    away = np.hypot(points[:, 0] - 0.2, points[:, 1]) / 0.15
    points[:, 2] = np.where(away < 1, 0.1 * (1 - away**2), 0)
    return Mesh(points, faces)


def test_a_part_is_the_faces_two_rings_around_what_bends():
    mesh = hill()
    raised = mesh.vertices[:, 2] != 0
    marked = raised
    for _ in range(3):  # what bends ends beside what is raised
        touched = marked[mesh.faces].any(axis=1)
        marked = np.zeros(len(raised), dtype=bool)
        marked[mesh.faces[touched]] = True
    part = bent_part(surroundings(mesh))
    assert part is not None
    assert part.seen is not None
    assert len(part.seen.mesh.faces) == touched.sum()
    assert set(part.vertices.rows) == set(np.flatnonzero(marked))
    assert len(part.seen.mesh.faces) < len(mesh.faces) / 5


def test_the_networks_see_no_more_than_the_part(monkeypatch):
    mesh, seen = hill(), []
    model = load_model()

    class Counting:
        card, name, hash = model.card, model.name, model.hash

        def __call__(self, features, budget):
            seen.append(len(features))
            return model(features, budget)

        def vertex_correction(self, features, budget):
            seen.append(len(features))
            return model.vertex_correction(features, budget)

    whole = by_arrays(mesh, 1, scheme=pns(Counting()))
    asked = sum(seen)
    assert 0 < asked < len(mesh.faces) / 5
    made = by_kernels(mesh, 1, scheme=pns(Counting()))
    assert sum(seen) == 2 * asked
    assert made.points.tobytes() == whole.points.tobytes()


def test_a_plane_has_no_part_and_becomes_loops():
    mesh = Mesh(*grid(20))
    part = bent_part(surroundings(mesh))
    assert part is not None
    assert part.seen is None
    scheme = replace(SCHEMES["bundled"], creases=NO_CREASES)
    made = by_kernels(mesh, 1, scheme=scheme)
    assert made.points.tobytes() == by_arrays(mesh, 1, scheme=scheme).points.tobytes()


def test_what_is_small_or_bends_for_the_most_part_is_not_cut(monkeypatch):
    monkeypatch.setattr(module, "LARGEST_PART", 0.5)
    assert bent_part(surroundings(hill())) is not None
    assert bent_part(surroundings(Mesh(*grid(40, lambda x, y: x * y)))) is None
    monkeypatch.setattr(module, "MOST_BENT", 0.5)
    assert bent_part(surroundings(Mesh(*grid(40, lambda x, y: x * y)))) is None
    monkeypatch.setattr(module, "LEAST_FACES", len(hill().faces) + 1)
    assert bent_part(surroundings(hill())) is None


def test_reports_of_a_mesh_that_is_cut_are_those_of_one_that_is_not(monkeypatch):
    mesh, scheme = hill(60), SCHEMES["bundled"]
    cut = refine(mesh, scheme, 2)
    monkeypatch.setattr(module, "LEAST_FACES", 10**9)
    assert refine(mesh, scheme, 2).report == cut.report
    assert cut.report["levels"][0]["shut"] > len(mesh.faces)
