"""Experiments share rows, sources and pictures."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.meshes import bent, grid
from train.experiments.harness.laboratory import SMALL, Laboratory
from train.experiments.harness.render import Camera, by_matplotlib, by_pyvista
from train.experiments.harness.sources import ROOT, code_of, sources_of
from train.experiments.harness.style import TITLES
from train.experiments.paper.hero_panels import write_panels
from train.experiments.paper.methods import hard_instance


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


CAMERA = Camera(azimuth=-62.0, elevation=42.0)


def picture(renderer):
    vertices, faces = grid(12, bent)
    return renderer(Mesh(vertices, faces), np.abs(vertices[:, 2]), 0.5, CAMERA)


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
