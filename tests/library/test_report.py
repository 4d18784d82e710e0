"""The distances from Loop in the report are those of Loop itself."""

import numpy as np
import pytest

from pns_common import Mesh, load_model, loop, pns
from tests.support.control_points import refine
from tests.support.meshes import bumpy_sphere, grid
from tests.support.networks import default_model

MODELS = [default_model(0), default_model(1, 200.0)]


def test_the_distance_is_the_largest_displacement_where_one_level_is_learned():
    mesh = Mesh(*bumpy_sphere())
    corrected, base = (refine(mesh, scheme, 1, creases=None) for scheme in (pns(MODELS[0]), loop()))
    apart = np.linalg.norm(corrected.mesh.vertices - base.mesh.vertices, axis=1).max()
    report = refine(mesh, pns(MODELS[0]), 3, creases=None).report
    assert report["limit_distance"] == pytest.approx(apart, rel=1e-12)
    assert report["learned_levels"] == 1
    first, second, _ = report["levels"]
    assert first["displacement_max"] == report["limit_distance"]
    assert first["envelope_max"] == report["limit_distance_bound"]
    assert not {"displacement_max", "envelope_max", "guarded"} & set(second)


def bump_in_a_plane(width):
    """A bump of one shape in a plane, whose faces are ``width`` times as large beside it."""
    points, faces = grid(13)
    x, y = points[:, 0], points[:, 1]
    z = np.where(np.hypot(x, y) < 0.3, 0.1, 0.0)
    far = [c + (width - 1) * np.sign(c) * np.maximum(np.abs(c) - 0.6, 0) for c in (x, y)]
    return Mesh(np.stack([*far, z], axis=1), faces)


def test_planes_are_allowed_nothing_however_large_their_faces():
    scheme = pns(load_model("paper"))
    bounds = [
        refine(bump_in_a_plane(width), scheme, reference_length=1.0).report["limit_distance_bound"]
        for width in (1, 30)
    ]
    assert bounds[0] == bounds[1] > 0


def test_levels_add_up_where_every_level_is_learned():
    report = refine(Mesh(*bumpy_sphere()), pns(load_model("paper")), 3).report
    assert report["learned_levels"] == 3
    total = sum(level["displacement_max"] for level in report["levels"])
    assert report["limit_distance"] == pytest.approx(total)
    assert "guarded" not in report["levels"][0]


def test_loop_is_at_no_distance_from_itself():
    for creases in (None, np.array([[0, 1]])):
        report = refine(Mesh(*grid(4)), loop(), 2, creases=creases).report
        numbers = [report[k] for k in ("learned_levels", "limit_distance", "limit_distance_bound")]
        assert numbers == [0, 0.0, 0.0]
        assert "displacement_max" not in report["levels"][0]
