"""Announce and count what is compiled."""

import numpy as np
import pytest

from pns_common import progress
from pns_common.kernels import inlined
from pns_common.progress import compiling


@pytest.fixture
def twice():
    """A kernel that calls another, compiled by nobody yet."""

    @inlined
    def double(x):
        return 2 * x

    @inlined
    def both(x):
        return double(x) + double(x)

    return both


def test_what_is_compiled_is_announced_once_and_its_time_counted(twice):
    said = []
    with compiling(said.append) as compiled:
        assert twice(1) == 4
    assert compiled.kernels == 1
    assert compiled.seconds > 0
    assert len(said) == 1
    with compiling(said.append) as again:
        assert twice(2) == 8
    assert (again.kernels, again.seconds, len(said)) == (0, 0, 1)
    assert twice(1.0) == 4
    assert (again.kernels, len(said)) == (0, 1)


def test_a_long_compilation_gives_signs_of_life(twice, monkeypatch):
    monkeypatch.setattr(progress, "QUIET", 0.0)
    said = []
    with compiling(said.append) as compiled:
        twice(1)
        twice(np.ones(3))
    assert compiled.kernels == 2
    assert said[1:] == ["kernels compiled so far: 1", "kernels compiled so far: 2"]
