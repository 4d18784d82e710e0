"""Older models keep their exact result: bits written down before what came after them.

Those of formats 1 and 2 before format 3, those of format 3 without side gates before these.

Bits depend on the processor (logarithms, tangents and matrix products round otherwise on another),
so they are asked for where the processor answers a probe as the one did that wrote them; positions
within 1e-6 are asked for everywhere.
"""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from pns_common import Mesh, load_model, pns, refine
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid
from tests.support.networks import scale_free_model

KEPT = Path(__file__).parent / "kept"
HASHES = json.loads((KEPT / "results.json").read_text())
PROBE = HASHES.pop("probe")
MESHES = {
    "bumpy": Mesh(*bumpy_sphere(0, subdivisions=1)),
    "patch": Mesh(*grid(6, bent)),
    "bow_tie": Mesh(*bow_tie()),
}
CREASES = np.array([[7, 8], [8, 9], [9, 10]])


def digest(*arrays):
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def probe():
    """What this processor makes of the functions that two processors may round differently."""
    x = np.random.default_rng(0).uniform(0.01, 2, (999, 18))
    answers = [load_model(name)(x[:, :k], 1.0) for name, k in (("paper", 5), ("signed", 18))]
    return digest(x, np.log(x), np.tanh(x), np.sqrt(x), *answers)


SAME_PROCESSOR = probe() == PROBE


@pytest.mark.parametrize("length", ["auto", "1.0"])
@pytest.mark.parametrize("mesh", sorted(MESHES))
@pytest.mark.parametrize("model", ["paper", "signed"])
def test_older_models_keep_their_exact_result(model, mesh, length):
    given = length if length == "auto" else float(length)
    refined = refine(MESHES[mesh], pns(load_model(model)), 2, given)
    name = f"{model}-{mesh}-{length}"
    if length == "auto":
        kept = np.load(KEPT / "positions.npz")[name]
        np.testing.assert_allclose(refined.mesh.vertices, kept, rtol=0, atol=1e-6)
    if SAME_PROCESSOR:
        bits = digest(refined.mesh.vertices, refined.mesh.faces, refined.ratio, refined.gate)
        assert bits == HASHES[name]


@pytest.mark.parametrize("mesh", sorted(MESHES))
def test_cards_without_side_gates_keep_their_exact_result(mesh):
    refined = refine(MESHES[mesh], pns(scale_free_model(0, boundary_strength=1.0)), 2)
    name = f"scale-free-{mesh}"
    kept = np.load(KEPT / "positions.npz")[name]
    np.testing.assert_allclose(refined.mesh.vertices, kept, rtol=0, atol=1e-6)
    if SAME_PROCESSOR:
        bits = digest(refined.mesh.vertices, refined.mesh.faces, refined.ratio, refined.gate)
        assert bits == HASHES[name]
