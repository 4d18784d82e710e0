"""Creases by the shape of a mesh: beyond an angle, or the lines that it shows."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Creases, crease_lines, loop
from pns_common.connectivity.creases import NO_CREASES
from pns_common.crease_lines import named_on
from pns_common.geometry.sharp_edges import edges_sharper_than
from service.meshes.shape_creases import creases_by_shape, lines_of
from service.options import Options
from train.data.primitives import box, cylinder

ASKED = Creases(line_angle=50.0, levels=3)
ASKING = replace(loop(), creases=ASKED)
LINES = Creases(line_angle=66.0, levels=2)


@pytest.mark.parametrize(
    ("crease", "scheme", "lines"),
    [
        ("auto", ASKING, ASKED),
        ("auto", loop(), NO_CREASES),
        ("lines", ASKING, LINES),
        ("lines", loop(), LINES),
        ("off", ASKING, NO_CREASES),
        ("angle:30", ASKING, NO_CREASES),
    ],
)
def test_who_asks_for_lines(crease, scheme, lines):
    found = lines_of(Options(crease=crease), scheme)
    assert (found.line_angle, found.levels) == (lines.line_angle, lines.levels)


def test_an_angle_takes_every_edge_beyond_it_for_good_and_lines_are_fewer_and_wear_off():
    mesh = cylinder(8)  # its walls meet at 45 degrees
    by_angle = creases_by_shape(mesh, Options(crease="angle:44"), ASKING)
    np.testing.assert_array_equal(
        by_angle.named, edges_sharper_than(mesh.vertices, mesh.faces, np.radians(44))
    )
    of_lines = named_on(mesh, creases_by_shape(mesh, Options(crease="lines"), ASKING))
    np.testing.assert_array_equal(of_lines.named, crease_lines(mesh))
    assert (len(by_angle.named), len(of_lines.named)) == (24, 16)
    assert (by_angle.levels, of_lines.levels) == (None, 2)
    assert creases_by_shape(box(), Options(crease="off"), ASKING).named is None
