"""The benchmarks' own parts: the peers' protocol, the meshes, the tables. No timing is asserted."""

import json
import subprocess
import sys

import numpy as np
import pytest

from benchmarks.contest import ROOT, Case, as_installed, contest, ours
from benchmarks.generated import ORDERS, unrolled_torus
from benchmarks.peers.protocol import read_mesh, write_mesh
from pns_common import load_model, pns, refine
from pns_common.mesh.topology import EdgeClass, build_topology
from service.meshfiles.mesh_file import NORMAL, UV


@pytest.mark.parametrize("order", ORDERS)
def test_generated_meshes_are_manifold_and_about_as_large_as_asked(order):
    mesh = ORDERS[order](4000)
    classes = np.bincount(mesh.topology().edge_class, minlength=4)
    assert abs(len(mesh.faces) - 4000) < 200
    assert classes[EdgeClass.IRREGULAR] == 0
    assert (classes[EdgeClass.BOUNDARY] > 0) == (order in ("open", "a third bent"))


def test_a_third_of_the_bent_patch_has_open_gates_and_a_part_has_crease_lines():
    scheme = pns(load_model())
    mesh = ORDERS["a third bent"](4000)
    gates = refine(mesh, scheme, 1).gate[len(mesh.vertices) :]
    assert np.mean(gates > 0) == pytest.approx(1 / 3, abs=0.05)
    edges = refine(ORDERS["parts"](4000), scheme, 1).report["levels"][0]["edges"]
    assert edges["soft"] * 12 >= edges["interior"]


def test_an_unrolled_torus_is_the_torus_cut_open():
    whole, cut = ORDERS["closed"](2000), unrolled_torus(2000)
    uv, normals = (cut.layers[name].values for name in (UV, NORMAL))
    corners = [of_mesh.vertices[of_mesh.faces] for of_mesh in (whole, cut)]
    np.testing.assert_array_equal(*corners)
    assert len(cut.vertices) == len(uv) == len(normals) > len(whole.vertices)
    edges = build_topology(cut.faces, len(cut.vertices))
    assert set(edges.edge_class) == {EdgeClass.INTERIOR, EdgeClass.BOUNDARY}
    # No texture lies across the cut.
    assert np.ptp(uv[cut.faces], axis=1).max() < 0.2


@pytest.mark.parametrize("order", ["open", "quads"])
def test_a_mesh_file_holds_what_was_written(tmp_path, order):
    mesh = ORDERS[order](50)
    write_mesh(tmp_path / "mesh", mesh.vertices, mesh.faces)
    points, faces = read_mesh(str(tmp_path / "mesh"))
    assert np.array_equal(points, mesh.vertices)
    assert np.array_equal(faces, mesh.faces)
    assert (points.dtype, faces.dtype) == (np.float64, np.int32)


@pytest.mark.parametrize("order", ["closed", "quads"])
def test_ours_answers_each_run_with_what_it_made(tmp_path, order):
    mesh = ORDERS[order](200)
    write_mesh(tmp_path / "mesh", mesh.vertices, mesh.faces)
    command = [*ours("loop", sys.executable), str(tmp_path / "mesh"), "2"]
    done = subprocess.run(
        command, input="run\nrun\n", capture_output=True, text=True, cwd=ROOT, check=True
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [a["faces"] for a in answers] == 2 * [16 * len(mesh.faces)]


def test_a_method_that_fails_is_left_out_by_name_and_the_others_have_their_turns():
    broken = [sys.executable, "-c", "raise SystemExit(1)"]
    commands = {"pns loop": ours("loop", sys.executable), "broken": broken}
    contested = contest(Case("closed", 200), commands, 2, {}, in_a_row=3)
    assert contested["left_out"] == {"broken": "failed"}
    # The first call, and a warm turn.
    assert contested["methods"]["pns loop"]["runs"] == 1 + 3


def test_modules_are_kept_compiled_as_an_installed_packages_are(monkeypatch):
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert "PYTHONDONTWRITEBYTECODE" not in as_installed()
    assert as_installed()["OMP_NUM_THREADS"] == "3"


def test_a_method_that_would_be_too_slow_is_not_started():
    contested = contest(
        Case("closed", 200),
        {"pns loop": ours("loop", sys.executable), "slow": ["no"]},
        2,
        {"slow": 99},
    )
    assert list(contested["left_out"]) == ["slow"]
