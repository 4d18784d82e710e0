"""Arguments out of range are refused by name, before any work."""

import numpy as np
import pytest

import pns_common
from pns_common import Mesh, ParameterError, loop, pns, refine, refinement
from tests.support.meshes import grid
from tests.support.networks import random_model

MODEL = random_model(0, scale=30.0)
MESH = Mesh(*grid(3))


REFUSED = {
    "mesh": [grid(3)],
    "scheme": ["butterfly", None],
    "levels": [0, -1, 17, 1.5, "2", True],
    "reference_length": [0.0, -1.0, np.nan, np.inf, "metres", None, np.ones(2), 10**400],
    "limit": ["no", np.ones(2)],
    "threads": [0, -1, 1.5],
}


@pytest.mark.parametrize("name", REFUSED)
def test_arguments_out_of_range_are_refused_by_name(name):
    for value in REFUSED[name]:
        given = {"mesh": MESH, "scheme": loop(), name: value}
        # Where annotations are enforced, another kind ends there first.
        with pytest.raises((ParameterError, TypeError), match=name):
            refine(**given)


def test_levels_that_cannot_fit_into_memory_are_refused(monkeypatch):
    made = refine(MESH, loop(), 3).mesh
    kept = made.vertices.nbytes + made.faces.nbytes
    monkeypatch.setattr(refinement, "memory_here", lambda: kept)
    refine(MESH, loop(), 2)
    with pytest.raises(ParameterError, match=r"512 faces take 0\.0 GiB or more") as caught:
        refine(MESH, loop(), 3)
    assert caught.value.name == "levels"
    monkeypatch.setattr(refinement, "memory_here", lambda: None)
    assert (refine(MESH, loop(), 3).mesh.vertices == made.vertices).all()


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int64])
def test_levels_and_threads_may_be_numpy_s_whole_numbers(kind):
    """Small ones end where faces are counted in them."""
    mesh = Mesh(*grid(8))
    made = refine(mesh, loop(), kind(3), threads=kind(100)).mesh
    assert (made.vertices == refine(mesh, loop(), 3).mesh.vertices).all()


@pytest.mark.parametrize("budget", [-0.1, float("nan"), float("inf")])
def test_budget_out_of_range_is_refused(budget):
    with pytest.raises(ParameterError, match="budget"):
        pns(MODEL, budget)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("scheme", lambda: pns_common.subdivide(grid(3), scheme=MODEL)),
        ("model", lambda: pns("general")),
        ("mesh", lambda: pns_common.clean(grid(3))),
        ("mesh", lambda: pns_common.cut_concave(grid(3))),
        ("mesh", lambda: pns_common.sharp_edges(grid(3))),
        ("source", lambda: pns_common.load_model(3)),
        ("progress", lambda: refine(Mesh(*grid(3)), loop(), progress="bar")),
    ],
)
def test_an_argument_of_another_kind_is_told(name, wrong):
    # Where annotations are enforced, another kind ends there first.
    with pytest.raises((ParameterError, TypeError), match=name):
        wrong()
