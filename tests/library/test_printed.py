"""What a user prints while trying things out fits a line, whatever it holds."""

import pytest

from pns_common import Mesh, load_model, loop, pns, refine
from pns_common.models.tied_form import Layer, tied_form
from pns_common.runtimes.numpy_network import open_network
from pns_common.runtimes.onnx_model import BUNDLED
from tests.support.meshes import bumpy_sphere
from tests.support.tied import VERTICES, tied_layers

MESH = Mesh(*bumpy_sphere(0))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (MESH, "Mesh(vertices=42, faces=80)"),
        (refine(MESH, loop()), "Refinement('loop', levels=1, vertices=162, faces=320)"),
        (loop(), "Scheme(name='loop'"),
        (pns(load_model()), "Scheme(name='pns', budget="),
        (load_model(), "OnnxModel(name='general', hash='"),
        (
            tied_form([Layer(*layer) for layer in tied_layers(VERTICES, (4, 3))], VERTICES),
            "TiedForm(widths=[4, 3], copies=2)",
        ),
        (
            open_network((BUNDLED / "paper.onnx").read_bytes(), "paper")[1],
            "NumpyNetwork(nodes=17, weights=9)",
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_it_fits_a_line(value, said):
    assert repr(value).startswith(said)
    assert len(repr(value)) <= 100
