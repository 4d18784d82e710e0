"""Experiments share rows, sources and pictures."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.meshes import bent, grid
from train.data.primitives import icosphere
from train.experiments.harness.experiment import Column, Table, column, table
from train.experiments.harness.laboratory import SMALL, Laboratory
from train.experiments.harness.render import HEIGHT, WIDTH, Camera, by_matplotlib, by_pyvista
from train.experiments.harness.sources import ROOT, code_of, sources_of
from train.experiments.harness.specular import MARGIN, SIDE, camera, shaded
from train.experiments.harness.style import TITLES
from train.experiments.paper.hero_panels import write_panels
from train.experiments.paper.methods import hard_instance


@dataclass(frozen=True, slots=True)
class Row:
    """Two columns, one of them formatted."""

    name: str = column("Name")
    gain: float | None = column("Gain %", "+.1f")


def test_fields_become_columns_and_values_cells():
    made = table("gains", "All gains", Row, (Row("a", 1.5), Row("b", gain=None)))
    columns = (Column("name", "Name"), Column("gain", "Gain %", "+.1f"))
    assert made == Table("gains", "All gains", columns, (("a", 1.5), ("b", None)))
    assert table("none", "No gains", Row, ()).columns == columns


def test_no_cell_is_left_out():
    with pytest.raises(TypeError, match="gain"):
        Row("a")


def names(module):
    return {str(path.relative_to(ROOT)) for path in sources_of(module)}


def test_sources_are_all_that_is_imported_at_any_depth():
    sources = names("train.experiments.paper.headline")
    assert {
        "train/experiments/paper/headline.py",
        "train/experiments/harness/comparison.py",
    } <= sources
    assert {
        "train/fitting/trainer.py",
        "train/surfaces/implicit.py",
        "pns_common/kernels/frames.py",
    } <= sources


def test_other_experiments_are_no_source_unless_they_are_imported():
    assert "train/experiments/paper/hero.py" not in names("train.experiments.paper.headline")
    assert "train/experiments/paper/ablation.py" in names("train.experiments.paper.published")


def test_modules_named_in_a_from_import_are_found():
    assert "train/experiments/paper/hero.py" in names("train.experiments.registry")


def test_other_packages_are_left_out():
    assert all(source.startswith(("train/", "pns_common/")) for source in names("train.run"))


def test_code_is_what_a_file_does_and_not_what_it_says(tmp_path):
    def code(text):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.py"
        path.write_text(text)
        return code_of(path)

    plain = code("A = 1\ndef f(x):\n    return x + A\n")
    told = code(
        '"""What."""\nA = 1\n"""A."""\n\ndef f(x):  # why\n    """How."""\n    return (x + A)\n'
    )
    assert plain == told
    assert plain != code("A = 2\ndef f(x):\n    return x + A\n")
    assert plain != code("A = 1\ndef f(x):\n    return 'how'\n")


BOX = np.array([[-1.0, -1, -1], [1, 1, 1]])
SPHERE = icosphere(4)


def drawn(mesh, azimuth=20):
    return shaded(mesh, camera(azimuth, 30), BOX)


def test_a_ball_covers_its_disc_and_nothing_else():
    picture = drawn(SPHERE)
    radius = SIDE / (MARGIN * np.sqrt(12))
    row, column = np.mgrid[:SIDE, :SIDE]
    away = np.hypot(row - SIDE / 2 + 0.5, column - SIDE / 2 + 0.5)
    covered = (picture < 1).any(axis=2)
    assert covered[away < radius - 2].all()
    assert not covered[away > radius + 2].any()


def test_a_ball_looks_the_same_from_all_sides_and_has_highlights():
    front, side = drawn(SPHERE), drawn(SPHERE, azimuth=77)
    assert np.abs(front - side).mean() < 0.01
    assert (front[SIDE // 2 - 60 : SIDE // 2 + 60].min(axis=2) > 0.95).any()


def test_ripples_show():
    angle = np.arctan2(SPHERE.vertices[:, 1], SPHERE.vertices[:, 0])
    rippled = Mesh(SPHERE.vertices * (1 + 0.01 * np.sin(16 * angle))[:, None], SPHERE.faces)
    assert np.abs(drawn(rippled) - drawn(SPHERE)).mean() >= 0.004


@pytest.mark.parametrize("up", [1, 2])
def test_cameras_are_rotations_that_look_level_with_their_axis_upright(up):
    view = camera(40, 0, up)
    np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view) == pytest.approx(1)
    np.testing.assert_allclose(view[1], np.eye(3)[up], atol=1e-12)


CAMERA = Camera(azimuth=-62.0, elevation=42.0)


def test_the_camera_is_a_rotation_that_looks_from_its_azimuth():
    axes = CAMERA.axes()
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_allclose(Camera(0, 0).axes()[2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(Camera(0, 90).axes()[2], [0, 0, 1], atol=1e-15)


def picture(renderer):
    vertices, faces = grid(12, bent)
    return renderer(Mesh(vertices, faces), np.abs(vertices[:, 2]), 0.5, CAMERA)


def test_the_mesh_fills_the_middle_and_leaves_the_corners_white():
    image = picture(by_matplotlib)
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert image.dtype == np.uint8
    assert (image[0, 0] == 255).all()
    assert (image[HEIGHT // 2, WIDTH // 2] < 255).any()
    assert 0.3 < (image < 250).any(axis=-1).mean() < 0.9


@pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="needs the extra render")
def test_pyvista_sees_the_same_outline():
    ours, theirs = (
        (picture(renderer) < 250).any(axis=-1) for renderer in (by_matplotlib, by_pyvista)
    )
    assert (ours != theirs).mean() < 0.03


@pytest.mark.training
def test_a_column_for_each_method_and_a_row_for_one_step_and_all(tmp_path: Path) -> None:
    folder = tmp_path / "panels"
    write_panels(Laboratory(SMALL, tmp_path / "networks", None, None, lambda *_: None), folder)
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["1-1.npz", *(f"{row}-{place}.npz" for row in (1, 2) for place in (2, 3, 4))]
    control = len(hard_instance().mesh.faces)
    for place, method in enumerate(("loop", "pns", "unconstrained"), start=2):
        for row, steps in ((1, 1), (2, SMALL.levels)):
            with np.load(folder / f"{row}-{place}.npz") as panel:
                assert panel["title"] == TITLES[method]
                assert len(panel["faces"]) == control * 4**steps
                assert panel["distance"].shape == (len(panel["vertices"]),)
                assert panel["distance"].min() >= 0
                # Loop is no distance from itself.
                assert ("ratio 0.00" in str(panel["note"])) == (method == "loop")
