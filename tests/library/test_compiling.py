"""Announce and count what is compiled, and forget what is stale."""

import os

import numpy as np
import pytest

from pns_common import kernels, progress
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


def test_code_older_than_a_source_is_forgotten_by_all_processes_that_start_at_once(
    tmp_path, monkeypatch
):
    source, kept = tmp_path / "loops.py", tmp_path / "__pycache__"
    kept.mkdir()
    for path in (source, kept / "old.nbc", kept / "new.nbi"):
        path.touch()
    os.utime(kept / "old.nbc", (1, 1))
    # To a process that listed it, a file that another has deleted since looks so.
    (kept / "gone.nbc").symlink_to(tmp_path / "nothing")
    monkeypatch.setattr(kernels, "__file__", str(source))
    kernels.forget_stale_code()
    assert {path.name for path in kept.iterdir()} == {"new.nbi", "gone.nbc"}
