"""What is no argument of a refinement is refused, by name."""

import numpy as np
import pytest

import pns_common
from pns_common import Mesh, ParameterError, arguments, loop, pns, refine
from tests.support.meshes import grid
from tests.support.networks import random_model

MODEL = random_model(0, scale=30.0)


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int64])
def test_levels_and_threads_may_be_numpy_s_whole_numbers(kind):
    """Small ones end where faces are counted in them."""
    mesh = Mesh(*grid(8))
    made = refine(mesh, loop(), kind(3), threads=kind(100)).mesh
    assert (made.vertices == refine(mesh, loop(), 3).mesh.vertices).all()


@pytest.mark.parametrize("levels", [0, -1, 17, 1.5, "2", True, None])
def test_levels_out_of_range_are_refused(levels):
    with pytest.raises(ParameterError) as caught:
        refine(Mesh(*grid(3)), loop(), levels)
    assert (caught.value.name, caught.value.value) == ("levels", levels)


def test_levels_that_cannot_fit_into_memory_are_refused(monkeypatch):
    mesh = Mesh(*grid(3))
    made = refine(mesh, loop(), 3).mesh
    kept = made.vertices.nbytes + made.faces.nbytes
    monkeypatch.setattr(arguments, "memory_here", lambda: kept)
    refine(mesh, loop(), 2)
    with pytest.raises(ParameterError, match=r"512 faces take 0\.0 GiB or more") as caught:
        refine(mesh, loop(), 3)
    assert caught.value.name == "levels"
    with pytest.raises(ParameterError, match="levels = 3: expected fewer"):
        pns_common.subdivide(grid(3), np.int8(3), loop())
    monkeypatch.setattr(arguments, "memory_here", lambda: None)
    assert (refine(mesh, loop(), 3).mesh.vertices == made.vertices).all()


@pytest.mark.parametrize(
    "length", [0.0, -1.0, float("nan"), float("inf"), "metres", None, np.ones(2), 10**400]
)
def test_reference_length_out_of_range_is_refused(length):
    with pytest.raises(ParameterError, match="reference_length"):
        refine(Mesh(*grid(3)), loop(), reference_length=length)


@pytest.mark.parametrize("budget", [-0.1, float("nan"), float("inf")])
def test_budget_out_of_range_is_refused(budget):
    with pytest.raises(ParameterError, match="budget"):
        pns(MODEL, budget)


@pytest.mark.parametrize("threads", [0, -1, 1.5])
def test_threads_out_of_range_are_refused(threads):
    with pytest.raises(ParameterError, match="threads"):
        refine(Mesh(*grid(3)), loop(), threads=threads)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("mesh", lambda: refine(grid(3), loop())),
        ("scheme", lambda: refine(Mesh(*grid(3)), "loop")),
        ("scheme", lambda: pns_common.subdivide(grid(3), scheme=MODEL)),
        ("model", lambda: pns("general")),
        ("mesh", lambda: pns_common.clean(grid(3))),
        ("mesh", lambda: pns_common.crease_lines(grid(3))),
        ("source", lambda: pns_common.load_model(3)),
        ("limit", lambda: refine(Mesh(*grid(3)), loop(), limit="no")),
        ("limit", lambda: refine(Mesh(*grid(3)), loop(), limit=np.ones(2))),
        ("progress", lambda: refine(Mesh(*grid(3)), loop(), progress="bar")),
    ],
)
def test_an_argument_of_another_kind_is_told(name, wrong):
    # Where annotations are enforced, another kind ends there first.
    with pytest.raises((ParameterError, TypeError), match=name):
        wrong()
