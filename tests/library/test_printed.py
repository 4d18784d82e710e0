"""A printed object fits a line, whatever it holds."""

import sys
from base64 import b64decode

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


@pytest.mark.parametrize("value", [MESH, refine(MESH, loop(), 1)])
def test_a_notebook_shows_a_picture_over_the_counts(value, monkeypatch):
    pytest.importorskip("pyvista")
    picture, _, table = value._repr_html_().partition("<table>")
    png = b64decode(picture.partition("base64,")[2].partition('"')[0])
    assert png.startswith(b"\x89PNG")
    assert len(png) < 100_000
    count = len(getattr(value, "mesh", value).vertices)
    assert f"<th>vertices</th><td>{count}</td>" in table
    monkeypatch.setitem(sys.modules, "pns_common.pyvista", None)
    assert value._repr_html_() == "<table>" + table
