"""Loops are compiled ahead of time, take what they were compiled for, and give numba's bits."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

from pns_common import kernels
from pns_common.kernels import normals

DIGEST = """
import hashlib
import numpy as np
from pns_common import Mesh, kernels, load_model, pns, refine
corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
halves = [half for a, b, c, d in quads for half in ([a, b, c], [a, c, d])]
digest = hashlib.sha256()
for faces in halves, quads[1:]:
    made = refine(Mesh(corners, faces), pns(load_model()), 2)
    digest.update(made.mesh.vertices.tobytes() + repr(made.report).encode())
print(bool(kernels.AHEAD), digest.hexdigest())
"""


def test_this_checkout_runs_what_was_compiled_of_its_sources():
    assert kernels.AHEAD, "run `make kernels`"


def test_numba_gives_the_same_bits():
    by_jit = {**os.environ, "KERNELS_JIT": "1"}
    said = [
        subprocess.run(
            [sys.executable, "-c", DIGEST], env=env, capture_output=True, text=True, check=True
        ).stdout.split()
        for env in (os.environ, by_jit)
    ]
    (ahead, made), (not_ahead, again) = said
    assert (ahead, not_ahead) == ("True", "False")
    assert made == again


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        (0, 3, np.zeros((3, 3)), 0),
        (0, 3, np.zeros((3, 3), np.float32)),
        (0, 3, np.zeros((3, 3), ">f8")),
        (0, 3, np.zeros(9)),
        (0, 3, np.zeros((6, 3))[::2]),
        (0, 3, np.zeros((3, 3)).T),
        (0, 1, [[0.0, 0.0, 0.0]]),
        (0.0, 3, np.zeros((3, 3))),
        ("0", 3, np.zeros((3, 3))),
        (None, None, None),
        (0, 3, (np.zeros((3, 3)), np.zeros((3, 3)))),
        (0, 3, (np.zeros((3, 3)),) * 40),
    ],
    ids=str,
)
def test_a_loop_refuses_what_it_was_not_compiled_for(arguments):
    with pytest.raises(
        TypeError, match=r"^normals\.scale_to_unit is compiled for \['int, int, f8_2d"
    ):
        normals.scale_to_unit(*arguments)


def test_code_of_other_sources_is_not_run(monkeypatch):
    other = hashlib.sha256(b"other").hexdigest()
    monkeypatch.setattr(kernels, "sources_digest", lambda: other)
    assert kernels._compiled() == {}


def test_without_loops_and_numba_the_error_says_what_to_do(monkeypatch):
    monkeypatch.setattr(kernels, "AHEAD", {})
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ImportError, match=r"pns-subdivision\[jit\]"):
        kernels._decorators()
