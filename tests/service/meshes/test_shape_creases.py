"""Creases by the shape of a mesh: beyond an angle, or those of the scheme."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Creases, loop
from service.gltf.refine.mesh_refine import creases_by_shape
from service.options import Options
from train.data.primitives import box, cylinder

ASKING = replace(loop(), creases=Creases(angle=40.0, levels=2))


@pytest.mark.parametrize(
    ("mesh", "crease", "scheme", "count"),
    [
        # The walls of a cylinder of eight sides meet at 45 degrees, and its rims at 90.
        (cylinder(8), "auto", ASKING, 24),
        (cylinder(8), "auto", loop(), 0),
        (cylinder(8), "off", ASKING, 0),
        (cylinder(8), "angle:44", ASKING, 24),
        (cylinder(8), "angle:46", ASKING, 16),
        (cylinder(8), "angle:180", ASKING, 0),
        (box(), "angle:89", loop(), 12),
    ],
)
def test_the_options_say_which_edges_are_sharp(mesh, crease, scheme, count):
    found = creases_by_shape(mesh, Options(crease=crease), scheme)
    named = np.zeros((0, 2)) if found.named is None else found.named
    assert len(named) == count
    turns = [turn(mesh, pair) for pair in named]
    assert all(angle > 40 for angle in turns)


def test_creases_of_a_scheme_wear_off_and_those_by_an_angle_do_not():
    by_scheme, by_angle = (
        creases_by_shape(box(), Options(crease=c), ASKING) for c in ("auto", "angle:89")
    )
    assert (by_scheme.levels, by_angle.levels) == (2, None)


def turn(mesh, pair):
    """Degrees between the two faces at an edge."""
    beside = [face for face in mesh.faces if set(pair) <= set(face)]
    a, b, c = (mesh.vertices[np.array(beside)[:, k]] for k in range(3))
    n, m = np.cross(b - a, c - a)
    return np.degrees(np.arccos(n @ m / np.linalg.norm(n) / np.linalg.norm(m)))
