"""The stages of a job: parts of parts, and a share that never goes back."""

from concurrent.futures import ThreadPoolExecutor

from hypothesis import given
from hypothesis import strategies as st

from service.stages import Stages


def test_parts_of_parts_tell_their_own_shares():
    told = []
    stages = Stages(moves=told.append)
    with stages.part(0.5, 1.0):
        stages.reach(0.5)
        with stages.part(0.5, 0.75):
            stages.reach(0.5)
        stages.reach(1.0)
    assert told == [0.5, 0.75, 0.75, 0.8125, 0.875, 1.0, 1.0]


@given(st.lists(st.floats(0, 1)))
def test_the_share_never_goes_back_whichever_thread_tells(shares):
    told = []
    stages = Stages(moves=told.append)
    for share in shares:
        stages.reach(share)
    assert told == [max(shares[: count + 1]) for count in range(len(shares))]
    del told[:]
    stages = Stages(moves=told.append)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(stages.reach, [*shares, 1.0]))
    assert told == sorted(told)
    assert (len(told), told[-1]) == (len(shares) + 1, 1)
