"""What holds for any weights holds for the worst that a search finds."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pns_common import Mesh
from pns_common.formula.fold_guard import FoldGuard
from pns_common.rules.scale_free_form import ScaleFreeForm
from tests.support.meshes import TETRAHEDRON, bent, bumpy_sphere, grid
from train.certificates import ascent
from train.certificates.ascent import GOALS, ascend

FORM = ScaleFreeForm(20.0, 1.0, 0.4, 75.0, 1)
LOOSE = replace(FORM, network_scale=2.0, boundary_strength=1.0)
MESHES = {
    "sphere": Mesh(*bumpy_sphere(0, subdivisions=0, bump=0.2)),
    "patch": Mesh(*grid(4, bent)),
    "tetrahedron": Mesh(
        np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]), TETRAHEDRON
    ),
}
ALLOWED = 1 + 1e-9


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize(("form", "loudness"), [(FORM, 1.0), (LOOSE, 100.0)])
def test_no_search_over_weights_and_mesh_breaks_a_promise(goal, mesh, form, loudness):
    worst = ascend(GOALS[goal], MESHES[mesh], form, seed=0, steps=12, loudness=loudness)
    for promise in ("turn", "displacement", "limit", "overshoot"):
        assert getattr(worst, promise) <= ALLOWED, (promise, worst)


def test_the_searches_climb():
    """From usual weights: a search that stands still proves nothing."""
    for goal in GOALS.values():
        assert ascend(goal, MESHES["sphere"], FORM, seed=0, steps=25).climbed > 0


def test_without_the_guard_the_same_search_folds_faces(monkeypatch):
    def open_guard(self, faces, loop, displacement, blocks=None, first=None):
        return np.ones(len(loop))

    monkeypatch.setattr(FoldGuard, "__call__", open_guard)
    worst = ascend(GOALS["fold"], MESHES["sphere"], LOOSE, seed=0, steps=25)
    assert worst.turn > 1


def test_without_the_projection_the_same_search_leaves_the_envelope(monkeypatch):
    import pns_common.formula.correction as correction

    tight = replace(FORM, budget=0.05)
    held = ascend(GOALS["limit distance"], MESHES["sphere"], tight, seed=0, steps=10)
    assert 0.9 < held.displacement <= ALLOWED
    monkeypatch.setattr(correction, "shortened", lambda vectors, longest: vectors)
    loose = ascend(GOALS["limit distance"], MESHES["sphere"], tight, seed=0, steps=10)
    assert loose.displacement > 1.5


def test_distances_are_measured_from_positions():
    """Not taken from what the step says of itself."""
    torch.manual_seed(0)
    mesh = MESHES["sphere"]
    assert ascent.ascend(GOALS["limit distance"], mesh, FORM, 1, 3).limit > 0.1
