"""One mesh cut into parts: the bits of `refine`, whatever the parts, their order, their kind."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from pns_common import Mesh, load_model, loop, pns, refine
from pns_common.connectivity.topology import build_topology
from service.cli import app
from service.options import Options
from tests.service.scale.large.parts import arrays, assert_is, contents, many_kinds, refined
from tests.support.meshes import bent, block, grid, manifolds, soups
from train.data.primitives import cylinder


@pytest.mark.parametrize("parts", [1, 2, 7, 64])
@pytest.mark.parametrize("creased", [False, True])
def test_parts_of_any_number_are_the_whole(tmp_path, parts, creased):
    mesh = many_kinds()
    edges = build_topology(mesh.faces, len(mesh.vertices)).edges
    creases = edges[::9] if creased else None
    report = refined(arrays(tmp_path / "in", mesh, creases), tmp_path / "out", parts)
    whole = refine(mesh, loop(), 2, creases=creases)
    assert_is(tmp_path / "out", whole)
    assert report["reference_length"] == whole.report["reference_length"]
    for level, expected in zip(report["levels"], whole.report["levels"], strict=True):
        assert {name: level[name] for name in ("vertices", "faces", "edges")} == {
            name: expected[name] for name in ("vertices", "faces", "edges")
        }


def test_parts_of_the_default_model_are_the_whole(tmp_path):
    mesh = many_kinds()
    report = refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 3, Options(levels=2))
    whole = refine(mesh, pns(load_model()), 2)
    assert_is(tmp_path / "out", whole)
    assert report["limit_distance"] == whole.report["limit_distance"] > 0
    assert report["levels"][0]["guarded"] == whole.report["levels"][0]["guarded"] > 0


def test_parts_of_an_even_mesh_have_the_prior_of_the_whole(tmp_path):
    mesh = Mesh(*grid(14, bent))
    report = refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 5, Options(levels=1))
    whole = refine(mesh, pns(load_model()))
    assert_is(tmp_path / "out", whole)
    assert report["prior_strength"] == whole.report["prior_strength"] > 1


@settings(max_examples=10)
@given(mesh=st.one_of(manifolds(), soups()), parts=st.integers(1, 64), levels=st.integers(1, 3))
def test_any_mesh_in_parts_is_the_whole(tmp_path_factory, mesh, parts, levels):
    folder = tmp_path_factory.mktemp("large")
    source = arrays(folder / "in", mesh)
    parts = min(parts, len(mesh.faces))
    refined(source, folder / "out", parts, Options(scheme="loop", levels=levels))
    assert_is(folder / "out", refine(mesh, loop(), levels))


def test_the_report_does_not_depend_on_the_parts(tmp_path):
    source = arrays(tmp_path / "in", many_kinds())
    one, many = (refined(source, tmp_path / f"out{p}", p) for p in (1, 13))
    assert one == many
    assert contents(tmp_path / "out1") == contents(tmp_path / "out13")


@pytest.mark.parametrize(("positions", "faces"), [("<f4", "<i4"), ("<f8", "<i8")])
def test_arrays_may_be_of_either_width(tmp_path, positions, faces):
    mesh = many_kinds()
    source = arrays(tmp_path / "in", mesh, positions=positions, faces=faces)
    refined(source, tmp_path / "out", 5)
    kept = Mesh(mesh.vertices.astype(positions), mesh.faces)
    assert_is(tmp_path / "out", refine(kept, loop(), 2))


def test_creases_by_angle_cross_parts(tmp_path):
    mesh = Mesh(*grid(13, lambda x, y: np.abs(x)))
    options = Options(scheme="loop", levels=2, crease="angle:60")
    report = refined(arrays(tmp_path / "in", mesh), tmp_path / "out", 9, options)
    assert report["levels"][0]["edges"]["crease"] == 12
    one = refined(tmp_path / "in", tmp_path / "one", 1, options)
    assert one == report
    assert contents(tmp_path / "one") == contents(tmp_path / "out")


@pytest.mark.parametrize("sides", [6, 12])
def test_parts_know_whether_the_whole_is_edged(tmp_path, sides):
    """By their own turns some would say otherwise: the walls of a cylinder, without its rims."""
    mesh = cylinder(sides, rows=4)
    source = arrays(tmp_path / "in", mesh)
    refined(source, tmp_path / "out", 9, Options(levels=2))
    assert_is(tmp_path / "out", refine(mesh, pns(load_model()), 2))


@pytest.mark.parametrize("named", [False, True])
def test_parts_keep_the_lines_of_the_whole_unless_creases_are_named(tmp_path, named):
    mesh = Mesh(*block(5))
    creases = mesh.faces[:3, :2] if named else None
    source = arrays(tmp_path / "in", mesh, creases)
    report = refined(source, tmp_path / "out", 4, Options(levels=2))
    whole = refine(mesh, pns(load_model()), 2, creases=creases if named else "auto")
    assert_is(tmp_path / "out", whole)
    assert report["limit_distance"] == whole.report["limit_distance"]
    first = report["levels"][0]
    assert first["edges"] == whole.report["levels"][0]["edges"]
    assert first["crease_shift_max"] == whole.report["levels"][0]["crease_shift_max"]
    assert (first["edges"]["crease"] == 60) != named


def test_the_command_refines_and_reports(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = Mesh(*grid(5, bent))
    arrays(tmp_path / "in", mesh)
    arguments = ["large", "in", "out", "--scheme", "loop", "--parts", "2", "--workers", "1"]
    done = CliRunner().invoke(app, [*arguments, "--report", "r.json"])
    assert done.exit_code == 0, done.output
    assert_is(tmp_path / "out", refine(mesh, loop(), 1))
    assert json.loads((tmp_path / "r.json").read_text())["levels"][0]["faces"] == 4 * len(
        mesh.faces
    )


def test_the_command_says_what_a_file_lost(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    points = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\n"
    (tmp_path / "in.obj").write_text(f"{points}f 1 2 3\nf 1 2 4\nf 1 2 2\nf 3 2 1\nf 2 1 3\n")
    arguments = ["large", "in.obj", "out", "--scheme", "loop", "--parts", "1", "--workers", "1"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert done.stderr.splitlines()[:-1] == [
        "2 × texture coordinates dropped",
        "1 × vertex colours dropped",
        "1 × degenerate faces dropped",
        "2 × duplicate faces dropped",
    ]
