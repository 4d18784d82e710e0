"""What the one door for jobs leaves behind it."""

import gc
import weakref

import pytest

from service.workers import worker


class Thing:
    """Holds itself, so that no count of references ends it."""

    def __init__(self) -> None:
        self.own = self


@pytest.mark.parametrize("fails", [False, True])
def test_what_a_job_leaves_in_cycles_is_gone_after_it(fails: bool) -> None:
    left: list[weakref.ref[Thing]] = []
    rare: list[tuple[int, int, int]] = []
    usual = gc.get_threshold()

    def job() -> None:
        left.append(weakref.ref(Thing()))
        rare.append(gc.get_threshold())
        if fails:
            raise ZeroDivisionError

    if fails:
        with pytest.raises(worker.JobFaultError):
            worker.call(job)
    else:
        worker.call(job)
    assert left[0]() is None
    assert rare[0][0] == worker.OBJECTS_A_SEARCH
    assert gc.get_threshold() == usual
