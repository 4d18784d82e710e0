"""Pieces: a mesh cut anyhow, each part refined alone, is the mesh refined, in bits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pns_common import Mesh, ParameterError, load_model, loop, pns, refine
from pns_common.blocks import Blocks
from pns_common.fold_guard import FoldGuard
from pns_common.onnx_model import bundled_models
from pns_common.pieces import (
    LevelTally,
    ThinHaloError,
    halo_rings,
    reach,
    reduced_report,
    refine_piece,
)
from pns_common.pieces.exact import guarded_exact, may_fold
from pns_common.topology import build_topology
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, soups
from tests.support.networks import random_model, scale_free_model, vertex_model
from tests.support.pieces import adjacent, piece_of, pieces_refined
from tests.support.schemes import along_normal

SCHEMES = {"loop": loop(), **{name: pns(load_model(name)) for name in bundled_models()}}
# Small networks, whose rules read as far as the bundled ones' do.
SMALL = {
    "scale-free": pns(scale_free_model(0)),
    "loop": loop(),
    "edges": pns(random_model(0)),
    "vertices": pns(vertex_model(0)),
    "wild": pns(scale_free_model(1, scale=30.0), budget=40.0),
}


def assert_pieces_are_the_whole(mesh, owner, scheme, levels, creases=None):
    whole = refine(mesh, scheme, levels, creases=creases)
    length = whole.report["reference_length"]
    if length == 0:
        return
    made = pieces_refined(mesh, owner, scheme, levels, length, creases)
    written = np.zeros(len(whole.mesh.faces), dtype=int)
    for piece in made:
        corners = piece.refined.points[piece.refined.faces[piece.own_children]]
        expected = whole.mesh.vertices[whole.mesh.faces[piece.children]]
        assert corners.tobytes() == expected.tobytes()
        written[piece.children] += 1
    assert (written == 1).all()
    assert_report_is_the_whole(reduced_report([p.refined.tallies for p in made]), whole.report)
    fans = sum(piece.refined.several_fans for piece in made)
    assert fans == whole.report["multi_fan_vertices"]


def assert_report_is_the_whole(reduced, report):
    for name in ("learned_levels", "limit_distance", "limit_distance_bound"):
        assert reduced[name] == report[name]
    for level, expected in zip(reduced["levels"], report["levels"], strict=True):
        assert level.keys() == expected.keys()
        for name, value in level.items():
            if isinstance(value, dict) and "max" in value:
                _assert_measured(value, expected[name])
            elif name == "vertex_rule":
                assert value["vertices"] == expected[name]["vertices"]
                for part in ("proximity_ratio", "gate"):
                    _assert_measured(value[part], expected[name][part])
            elif name != "vertices":  # isolated ones are no piece's
                assert value == expected[name], name


def _assert_measured(measured, expected):
    assert measured["max"] == expected["max"]
    assert measured["mean"] == pytest.approx(expected["mean"], abs=1e-11)
    assert measured.get("active") == pytest.approx(expected.get("active"))


@pytest.mark.parametrize("name", SMALL)
@settings(max_examples=6)
@given(mesh=st.one_of(manifolds(), soups()), parts=st.integers(1, 8), seed=st.integers(0, 99))
def test_pieces_of_any_mesh_are_the_whole(name, mesh, parts, seed):
    owner = np.random.default_rng(seed).integers(0, parts, len(mesh.faces))
    assert_pieces_are_the_whole(mesh, owner, SMALL[name], 2)


@pytest.mark.parametrize("name", SCHEMES)
def test_pieces_with_boundaries_and_creases_are_the_whole(name):
    points, faces = grid(14, bent)
    rng = np.random.default_rng(0)
    mesh = Mesh(points, rng.permutation(faces))
    edges = build_topology(mesh.faces, len(points)).edges
    owner = (points[mesh.faces].mean(axis=1)[:, :2] > 0.1) @ [1, 2]
    creases = edges[rng.choice(len(edges), 40, replace=False)]
    assert_pieces_are_the_whole(mesh, owner, SCHEMES[name], 2, creases)


@pytest.mark.parametrize("name", SMALL)
def test_pieces_without_kernels_are_the_whole_too(name, monkeypatch):
    monkeypatch.setattr("pns_common.pieces.piece.kernels_available", lambda: False)
    points, faces = grid(7, bent)
    faces = np.concatenate([faces, faces[:2], [[0, 5, 20]]])
    owner = (points[faces].mean(axis=1)[:, 0] > 0.1).astype(int)
    assert_pieces_are_the_whole(Mesh(points, faces), owner, SMALL[name], 2, faces[3:5, :2])


def test_rings_that_a_piece_needs():
    needed = {
        name: [halo_rings(scheme, n) for n in (1, 2, 3, 6)] for name, scheme in SCHEMES.items()
    }
    assert needed == {
        "loop": [2, 2, 2, 2],
        "paper": [2, 2, 2, 2],
        "signed": [3, 4, 4, 4],
        "full": [3, 4, 4, 4],
        "general": [4, 4, 4, 4],
    }


@pytest.mark.parametrize("name", SCHEMES)
def test_a_level_reads_as_far_as_its_reach_and_no_farther(name):
    scheme = SCHEMES[name]
    points, faces = bumpy_sphere(3, 2)
    before = refine(Mesh(points, faces), scheme, 1, 1.0).mesh
    moved = points.copy()
    moved[0] *= 1.001
    after = refine(Mesh(moved, faces), scheme, 1, 1.0).mesh
    changed = (before.vertices != after.vertices).any(axis=1)[before.faces].any(axis=1)
    parents = changed.reshape(-1, 4).any(axis=1)
    at_vertex = (faces == 0).any(axis=1)
    assert not (parents & ~adjacent(faces, at_vertex, reach(scheme, 0))).any()
    assert (parents & ~adjacent(faces, at_vertex, reach(scheme, 0) - 1)).any()


@pytest.mark.parametrize("name", SCHEMES)
def test_a_halo_that_is_too_thin_is_told(name):
    scheme = SCHEMES[name]
    mesh = Mesh(*bumpy_sphere(5, 2))
    own = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.85
    for levels in (1, 2):
        rings = halo_rings(scheme, levels, guard_rings=0)
        with pytest.raises(ThinHaloError) as told:
            refine_piece(piece_of(mesh, own, rings - 1).piece, scheme, levels, 1.0, Blocks(1))
        assert told.value.faces > 0


def test_a_scheme_of_unknown_rules_has_no_known_reach():
    with pytest.raises(ParameterError, match="scheme"):
        halo_rings(along_normal(0.1), 1)


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.01, 2))
def test_no_scales_fold_what_may_not_fold(seed, size):
    rng = np.random.default_rng(seed)
    loop_points, asked = rng.standard_normal((2, 60, 3))
    faces, guard = np.arange(60).reshape(20, 3), FoldGuard(1.0)
    asked *= size * 0.2
    safe = ~may_fold(faces, loop_points, asked, guard.angle)
    for _ in range(20):
        scale = rng.choice([0, 0.25, 0.5, 1], 60) if rng.random() < 0.5 else rng.random(60)
        s = guard(faces[safe], loop_points, scale[:, None] * asked)
        assert (s == 1).all()


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.01, 0.6))
def test_what_is_exact_behind_the_guard_hangs_on_nothing_unknown(seed, size):
    rng = np.random.default_rng(seed)
    points, faces = grid(16)
    asked = size / 16 * rng.standard_normal(points.shape)
    known = points[faces].mean(axis=1)[:, 0] > rng.uniform(-0.9, 0.5)
    exact = guarded_exact(known, faces, points, asked, 1.0)
    sure = np.unique(faces[exact])
    at_unknown = np.setdiff1d(np.arange(len(points)), np.unique(faces[known]))
    scales = []
    for _ in range(3):
        changed = asked.copy()
        changed[at_unknown] = rng.standard_normal((len(at_unknown), 3))
        scales.append(FoldGuard(1.0)(faces, points, changed)[sure])
    assert (scales[0] == scales[1]).all()
    assert (scales[0] == scales[2]).all()
    assert not (exact & ~known).any()


def test_tallies_cross_to_a_file_and_back():
    mesh = Mesh(*bumpy_sphere(1, 1))
    (made,) = pieces_refined(mesh, np.zeros(len(mesh.faces), int), SCHEMES["general"], 2, 1.0)
    for tally in made.refined.tallies:
        assert LevelTally.of_dict(tally.as_dict()) == tally
