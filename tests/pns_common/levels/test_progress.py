"""How far a refinement is: told inside every level, and what it raises ends it."""

import itertools
import sys

import numpy as np
import pytest

from pns_common import Mesh, load_model, loop, pns, refine
from pns_common.levels.progress import LEARNED_COST, LIMIT_COST
from tests.support.meshes import grid
from tests.support.networks import random_model

MODEL = random_model(0, scale=30.0)


@pytest.mark.parametrize(
    "scheme", [loop(), pns(MODEL), pns(load_model())], ids=["loop", "all levels", "one level"]
)
@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("compiled", [False, True])
def test_progress_moves_inside_every_level_and_ends_at_all_faces(
    scheme, limit, compiled, monkeypatch
):
    """Level by level the faces are known: what is told between their ends is inside a level."""
    module = sys.modules["pns_common.refine"]
    monkeypatch.setattr(module, "kernels_pay", lambda faces: compiled)
    mesh = Mesh(*grid(11))
    calls = []
    told = lambda done, total: calls.append((done, total))  # noqa: E731
    seen = refine(mesh, scheme, 3, limit=limit, threads=2, progress=told)
    shares = [done / total for done, total in calls]
    assert {total for _, total in calls} == {200 * (4 + 16 + 64)}
    assert shares == sorted(shares)
    assert shares[-1] == 1
    costs = [
        200 * 4**level * (LEARNED_COST if level <= _learned(scheme, 3) else 1)
        for level in range(1, 4)
    ]
    costs += [200 * 64 * LIMIT_COST] * limit
    ends = np.cumsum([0, *costs]) / sum(costs)
    for start, end in itertools.pairwise(ends):
        assert any(start + 1e-3 < share < end - 1e-3 for share in shares), (start, end)
    plain = refine(mesh, scheme, 3, limit=limit)
    np.testing.assert_array_equal(seen.mesh.vertices, plain.mesh.vertices)
    assert seen.report == plain.report


def _learned(scheme, levels):
    return levels if scheme.learned_levels is None else scheme.learned_levels


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("at", [0.1, 0.6, 0.99])
def test_what_progress_raises_ends_the_refinement_before_the_next_block(at, compiled, monkeypatch):
    module = sys.modules["pns_common.refine"]
    monkeypatch.setattr(module, "kernels_pay", lambda faces: compiled)
    calls = []

    def enough(done, total):
        calls.append(done)
        if done >= at * total:
            raise StopRefiningError

    with pytest.raises(StopRefiningError):
        refine(Mesh(*grid(11)), loop(), 3, threads=1, progress=enough)
    assert [done >= at * 200 * 84 for done in calls] == [False] * (len(calls) - 1) + [True]


class StopRefiningError(Exception):
    """Nobody wants it."""
