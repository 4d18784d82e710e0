"""The steps of a piece: compiled or not, they are the same, down to what is kept of each."""

from itertools import islice

import numpy as np
import pytest

from pns_common import loop, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import Creases
from pns_common.pieces.steps import steps_by_arrays, steps_by_kernels
from tests.support.meshes import bent, bow_tie, grid, three_pages
from tests.support.networks import scale_free_model, vertex_model

SCHEMES = {"loop": loop(), "guarded": pns(scale_free_model(0)), "free": pns(vertex_model(0))}
MESHES = {"open": grid(4, bent), "bow-tie": bow_tie(), "three pages": three_pages()}


def both(mesh, scheme, creases=None):
    arguments = (*MESHES[mesh], Creases(creases), SCHEMES[scheme], 1.0, Blocks(1))
    return [list(islice(steps(*arguments), 2)) for steps in (steps_by_arrays, steps_by_kernels)]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("mesh", MESHES)
def test_compiled_steps_are_the_others(mesh, scheme):
    for plain, compiled in zip(*both(mesh, scheme), strict=True):
        np.testing.assert_array_equal(compiled.points, plain.points)
        np.testing.assert_array_equal(compiled.children, plain.children)
        assert (compiled.placed is None) == (plain.placed is None)
        assert (compiled.loop is None) == (plain.loop is None)
        for name in (
            "vertex_count",
            "faces",
            "edge_class",
            "interior",
            "first",
            "multi_fan_vertices",
        ):
            ours, theirs = getattr(compiled.links, name), getattr(plain.links, name)
            np.testing.assert_array_equal(ours, theirs)
        paired = plain.links.second >= 0
        np.testing.assert_array_equal(compiled.links.second[paired], plain.links.second[paired])
        assert (compiled.links.second[~paired] < 0).all()


def test_what_the_guard_lets_stand_cannot_be_flipped():
    guarded, free = both("open", "guarded")[1], both("open", "free")[1]
    assert [step.may_flip for step in guarded] == [False, False]
    assert [step.may_flip for step in free] == [True, True]


def test_the_first_half_edge_is_where_an_edge_first_appears():
    step = both("three pages", "loop")[0][0]
    a, b = (
        step.links.faces.reshape(-1)[step.links.first],
        np.roll(step.links.faces, -1, axis=1).reshape(-1)[step.links.first],
    )
    pairs = np.sort(np.stack([a, b], axis=1), axis=1).tolist()
    assert pairs == [[0, 1], [1, 2], [0, 2], [1, 3], [0, 3], [1, 4], [0, 4]]
    assert (step.links.second < 0).all()
