"""A bundled model is the one that was bundled, to the last bit."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pns_common import Mesh, ModelError, clean, pns, sharp_edges, subdivide
from pns_common.model import file as model_file
from pns_common.model.file import (
    BUNDLED,
    MANIFEST,
    bundled_models,
    check_file,
    load_model,
    write_manifest,
)
from tests.support.polygons import cylinder


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the bundled files, in their place."""
    for entry in BUNDLED.iterdir():
        if entry.is_file():
            (tmp_path / entry.name).write_bytes(entry.read_bytes())
    monkeypatch.setattr(model_file, "BUNDLED", tmp_path)
    return tmp_path


def test_sha256sum_agrees():
    command = ["sha256sum", "--check", "--strict", MANIFEST]
    subprocess.run(command, cwd=Path(str(BUNDLED)), check=True, capture_output=True)


@pytest.mark.parametrize("name", bundled_models(companions=True))
def test_every_bundled_model_keeps_the_contract_and_loads(name):
    """Loading trusts the hash, so the check is here."""
    model = load_model(name)
    assert model.name == name
    assert model.card == check_file((BUNDLED / f"{name}.onnx").read_bytes(), name)


def test_bundled_models_load_without_the_package_onnx_and_no_others_do(monkeypatch):
    """As in Blender, whose archive leaves it out."""
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert load_model().card.format == 5
    with pytest.raises(ModelError, match="the package onnx"):
        load_model(Path(str(BUNDLED)) / "paper.onnx")


@pytest.mark.parametrize("name", bundled_models(companions=True))
def test_a_flipped_bit_is_refused_wherever_it_is(package, name):
    path = package / f"{name}.onnx"
    whole = path.read_bytes()
    for place in (0, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(ModelError, match=MANIFEST):
            load_model(name)
    path.write_bytes(whole)
    assert load_model(name).name == name


def test_without_its_hash_no_bundled_model_is_loaded(package):
    (package / MANIFEST).write_text("")
    with pytest.raises(ModelError, match="not listed"):
        load_model("paper")
    (package / MANIFEST).unlink()
    with pytest.raises(ModelError, match="beside the bundled models"):
        load_model("paper")


def test_a_new_manifest_lists_what_is_there(package):
    (package / "paper.onnx").rename(package / "mine.onnx")
    write_manifest(package)
    assert load_model("mine").name == "mine"
    assert sorted(
        entry.name for entry in package.iterdir() if entry.suffix not in (".py", ".onnx")
    ) == [MANIFEST]


def test_models_load_and_answer_without_anything_of_training():
    """The service has no package of training installed."""
    code = """if True:
        import sys
        absent = "torch", "scipy", "safetensors", "msgspec", "trimesh", "train", "export"
        sys.modules.update(dict.fromkeys(absent))
        import numpy as np
        from pns_common.model.file import BUNDLED, bundled_models, load_model
        from pns_common.model.session import networks
        for name in bundled_models(companions=True):
            for source in (name, BUNDLED / f"{name}.onnx"):
                model = load_model(source)
                for each in networks(model.card):
                    made = model.run(each.given, np.ones((7, each.columns)))
                    assert made.shape == (7, each.answer_columns)
    """
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("levels", [2, 3, 4])
def test_a_drum_of_twelve_sides_is_round_and_a_box_of_quads_a_box(levels):
    made = subdivide(Mesh(*cylinder(12, height=2.0)), levels=levels).vertices
    size = np.hypot(made[:, 0], made[:, 1])
    walls = (made[:, 2] > 0.01) & (made[:, 2] < 1.99)
    # The prism itself is off by .034, at each of its sides.
    np.testing.assert_allclose(size[walls], 1, atol=0.033)
    assert np.ptp(size[walls]) < 0.03
    # Rims are crisp: some of it lies where walls and lids meet.
    assert np.hypot(size - 1, made[:, 2] - 2).min() < 0.02
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) - 0.5
    sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    box = subdivide(Mesh(corners, sides), levels=levels).vertices
    np.testing.assert_allclose(np.abs(box).max(axis=1), 0.5, atol=0.005)


def test_rims_of_a_drum_stay_sharp_where_loops_run_around_it():
    points, faces = cylinder(12, height=0.7)
    rings = np.concatenate([points, points[12:] + np.array([0, 0, 0.7])])
    lid = [v + 12 for v in faces[1]]
    mesh = Mesh(rings, [faces[0], lid, *faces[2:], *(np.array(faces[2:]) + 12).tolist()])
    sharp = np.sort(sharp_edges(mesh, scheme=pns(load_model())), axis=1)
    rims = [sorted((k, (k + 1) % 12)) for k in range(12)]
    expected = [*rims, *([a + 24, b + 24] for a, b in rims)]
    assert sorted(sharp.tolist()) == sorted(expected)
    moved = subdivide(mesh, levels=1).vertices[:36] - rings
    assert np.linalg.norm(moved, axis=1).max() < 0.03


def test_the_hull_of_a_disc_and_a_box_keeps_its_steep_edges():
    # Such hulls stand for a robot's parts: none of their edges is marked by a loop of faces.
    turn = 2 * np.pi * np.arange(24) / 24
    disc = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    box = [[x, y, z] for x in (0.5, 2) for y in (-0.6, 0.6) for z in (0, 1)]
    hull = ConvexHull(np.concatenate([1.2 * disc, disc + np.array([0, 0, 0.6]), box]))
    a, b, c = hull.points[hull.simplices].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    mesh = clean(Mesh(hull.points, faces)).mesh
    steep, kept = sharp_edges(mesh, 60), sharp_edges(mesh, scheme=pns(load_model()))
    assert len(steep) > 15
    assert {*map(frozenset, steep.tolist())} <= {*map(frozenset, kept.tolist())}
