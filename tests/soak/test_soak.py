"""A short soak, in CI: it asserts no time, only that no answer is wrong."""

import os

import pytest

from tests.soak import process
from tests.soak.process import least_held_by, lines_of, started
from tests.soak.run import soak

# An attack goes on until it has struck, however few its own are.
SECONDS = 6


@pytest.fixture(scope="module")
def soaked(tmp_path_factory):
    """Return the result of a soak, and the service's log."""
    log = tmp_path_factory.mktemp("soak") / "log"
    with started(log) as (address, pid):
        tally = soak(address, SECONDS, pid, say=lambda text: None)
    return tally, lines_of(log)


def test_no_answer_is_wrong_and_none_is_a_fault(soaked):
    tally = soaked[0].tally
    assert tally.answers["glb 200"] + tally.answers["small 200"] > 0
    assert tally.wrong == []
    assert tally.faults() == {}


def test_every_line_of_the_log_is_json_and_short(soaked):
    lines = soaked[1]
    assert any(line.get("route") == "/subdivide" for line in lines)
    assert all(len(str(line)) < 10_000 for line in lines)


def test_nothing_is_kept_open(soaked):
    before, after = soaked[0].before, soaked[0].after
    # Requests that are under way hold a few.
    assert after.descriptors <= before.descriptors + 40


def test_memory_is_the_least_of_each_process_and_of_a_new_one_its_last(monkeypatch):
    # Two hold more in turn, so that their sum never falls.
    seen = iter([{1: 9, 2: 5}, {1: 4, 2: 9}, {1: 9, 2: 5, 3: 1}, {1: 8, 2: 6, 3: 2}])
    last = {}

    def sizes(pid):
        last.update(next(seen, last))
        return {one: 1024 * size for one, size in last.items()}

    monkeypatch.setattr(process, "_sizes", sizes)
    held = least_held_by(os.getpid(), 2.0)
    assert (held.mebibytes, held.processes) == (4 + 5 + 2, 3)
