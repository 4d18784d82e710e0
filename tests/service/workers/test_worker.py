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


@pytest.mark.parametrize(("given", "then"), [("0\n", "500"), ("875\n", "1000"), ("-998\n", "-498")])
def test_a_worker_is_preferred_to_its_server_and_never_less_than_it_was(given, then, tmp_path):
    """A pod of a cluster begins where it must not go below: at 875, or wherever its memory says."""
    preference = tmp_path / "oom_score_adj"
    preference.write_text(given)
    worker.prefer(preference)
    assert preference.read_text() == then


def test_a_worker_starts_where_no_preference_can_be_had(tmp_path):
    """Nor where there is none at all."""
    tmp_path.joinpath("refused").mkdir()
    worker.prefer(tmp_path / "refused")
    worker.prefer(tmp_path / "missing")
