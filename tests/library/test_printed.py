"""What a user prints while trying things out fits a line, whatever it holds."""

import pytest

from pns_common import Mesh, load_model, loop, pns, refine
from tests.support.meshes import bumpy_sphere

MESH = Mesh(*bumpy_sphere(0))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (MESH, "Mesh(vertices=42, faces=80)"),
        (refine(MESH, loop(), 1), "Refinement('loop', levels=1, vertices=162, faces=320)"),
        (loop(), "Scheme(name='loop'"),
        (pns(load_model()), "Scheme(name='pns', learned_levels=1, budget="),
        (load_model(), "OnnxModel(name='general', hash='"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_it_fits_a_line(value, said):
    assert repr(value).startswith(said)
    assert len(repr(value)) <= 100
