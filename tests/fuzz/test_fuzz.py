"""A short run of the fuzzer: the long one is `make fuzz`."""

import random

import pytest

from tests.fuzz.mutate import mutated
from tests.fuzz.run import ALLOWANCE, LIMITS, MIB, outcome, run
from tests.fuzz.seeds import made

SEEDS = made()


@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: seed.name)
def test_seeds_are_well_formed(seed):
    assert outcome(seed, seed.body) == "refined"


def test_malformed_files_give_results_or_named_refusals(tmp_path):
    tally = run(SEEDS, 1500, 60.0, 10_000_000, tmp_path / "body")
    assert tally.run > 100
    assert not tally.faults
    assert tally.peak * MIB < LIMITS.max_memory_bytes + ALLOWANCE
    assert {"refined", "invalid-gltf", "unreadable"} <= set(tally.outcomes)


def test_an_input_follows_from_its_number():
    for number in range(50):
        first, second = (random.Random(number) for _ in range(2))
        assert mutated(SEEDS[0], first) == mutated(SEEDS[0], second)
