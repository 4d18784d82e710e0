"""Pieces: a mesh cut anyhow, each part refined alone, is the mesh refined, in bits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pns_common import Creases, Mesh, crease_lines, load_model, loop, pns, refine
from pns_common.connectivity.creases import NO_CREASES
from pns_common.connectivity.topology import build_topology
from pns_common.crease_lines import turns_of_parts
from pns_common.geometry.crease_lines import is_edged
from pns_common.geometry.side_lengths import measure_sides
from pns_common.pieces import (
    reduced_report,
)
from pns_common.runtimes.onnx_model import bundled_models
from tests.support.crease_lines import tube
from tests.support.meshes import bent, grid, manifolds, soups
from tests.support.networks import random_model, scale_free_model, vertex_model
from tests.support.pieces import pieces_refined

SCHEMES = {"loop": loop(), **{name: pns(load_model(name)) for name in bundled_models()}}
# Small networks, whose rules read as far as the bundled ones' do.
SMALL = {
    "scale-free": pns(scale_free_model(0)),
    "loop": loop(),
    "edges": pns(random_model(0)),
    "vertices": pns(vertex_model(0)),
    "wild": pns(scale_free_model(1, scale=30.0), budget=40.0),
}


def assert_pieces_are_the_whole(mesh, owner, scheme, levels, creases=None, lines=NO_CREASES):
    whole = refine(mesh, scheme, levels, creases=lines if creases is None else creases)
    length = whole.report["reference_length"]
    if length == 0:
        return
    fitted = scheme.fitted(lambda: measure_sides(mesh.vertices, mesh.faces))
    if lines.edged_angle is not None:
        lines = replace(lines, edged=is_edged_mesh(mesh, lines))
    made = pieces_refined(mesh, owner, fitted, levels, length, creases, lines)
    written = np.zeros(len(whole.mesh.faces), dtype=int)
    for piece in made:
        corners = piece.refined.points[piece.refined.faces[piece.own_children]]
        expected = whole.mesh.vertices[whole.mesh.faces[piece.children]]
        assert corners.tobytes() == expected.tobytes()
        written[piece.children] += 1
    assert (written == 1).all()
    assert_report_is_the_whole(reduced_report([p.refined.tallies for p in made]), whole.report)
    fans = sum(piece.refined.multi_fan_vertices for piece in made)
    assert fans == whole.report["multi_fan_vertices"]


def is_edged_mesh(mesh, lines):
    whole = np.zeros(len(mesh.faces), dtype=np.int64)
    return is_edged(*turns_of_parts(mesh.vertices, mesh.faces, lines, whole, 1)[0].tolist())


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


def pleats(n, seed, gentle=0.0):
    """A sheet of pleats, each smoothed out from somewhere on: lines with loose ends everywhere.

    ``gentle`` is the share of those that are a third as high.
    """
    points, faces = grid(n)
    row, column = np.divmod(np.arange(n * n), n)
    rng = np.random.default_rng(seed)
    ends = rng.integers(6, n + 6, n)
    height = np.where(rng.random(n) < gentle, 1 / 3, 1.0) * 2 / (n - 1)
    points[:, 2] = np.where((row % 2 == 1) & (column < ends[row]), height[row], 0)
    return Mesh(points, faces)


def test_pieces_find_the_lines_of_the_whole():
    """Lines run on, out of a piece and along its halo: it is wide enough to tell where they end."""
    mesh, lines = pleats(24, 0), Creases(line_angle=66.0, levels=2)
    owner = (mesh.vertices[mesh.faces].mean(axis=1)[:, :2] // 0.3) @ [1, 20]
    assert_pieces_are_the_whole(mesh, owner, loop(), 3, lines=lines)
    assert len(crease_lines(mesh)) > 100


def test_pieces_find_the_edges_between_walls_that_were_cut_finely():
    """Half way up the walls are no longer plane, and their edges lose as many as are dropped."""
    mesh, rng = tube(8, across=3, rows=24), np.random.default_rng(0)
    moved = mesh.vertices + 0.01 * rng.standard_normal(mesh.vertices.shape)
    mesh = Mesh(np.where(mesh.vertices[:, 2:] > 1, moved, mesh.vertices), mesh.faces)
    lines = Creases(line_angle=66.0, levels=2, edged_angle=21.0)
    assert 8 * 5 < len(crease_lines(mesh)) < 8 * 12
    for seed in range(3):
        owner = np.random.default_rng(seed).integers(0, 6, 24 * 2)
        owner = np.repeat(owner, len(mesh.faces) // len(owner))
        assert_pieces_are_the_whole(mesh, owner, loop(), 2, lines=lines)


def test_pieces_of_an_edged_mesh_find_its_gentler_lines():
    """Of a piece that has no sharp edge, too; and whether an edge stands alone is seen there."""
    mesh = pleats(24, 0, gentle=0.2)
    lines = Creases(line_angle=66.0, levels=2, edged_angle=20.0)
    assert is_edged_mesh(mesh, lines)
    assert len(crease_lines(mesh)) > len(crease_lines(mesh, 66.0)) + 50
    for side in (0.3, 0.17):
        owner = (mesh.vertices[mesh.faces].mean(axis=1)[:, :2] // side) @ [1, 40]
        assert_pieces_are_the_whole(mesh, owner, loop(), 2, lines=lines)


@pytest.mark.parametrize("name", SMALL)
def test_pieces_without_kernels_are_the_whole_too(name, monkeypatch):
    monkeypatch.setattr("pns_common.pieces.piece.kernels_available", lambda: False)
    points, faces = grid(7, bent)
    faces = np.concatenate([faces, faces[:2], [[0, 5, 20]]])
    owner = (points[faces].mean(axis=1)[:, 0] > 0.1).astype(int)
    assert_pieces_are_the_whole(Mesh(points, faces), owner, SMALL[name], 2, faces[3:5, :2])
