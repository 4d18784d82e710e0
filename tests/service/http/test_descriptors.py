"""Files that may be open: connections are as many as there is room for beside everything else."""

import re
import resource

import pytest

from service.http.room import connections_that_fit
from service.settings import Settings, StartError

SETTINGS = Settings(workers=1, queue=2, connections=100)


def allow(monkeypatch: pytest.MonkeyPatch, soft: int, hard: int) -> list[tuple[int, int]]:
    """A system with these limits; the list tells what was asked of it."""
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (soft, hard))
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: asked.append(limits))
    return asked


def test_the_limit_is_raised_as_far_as_is_needed_and_allowed(monkeypatch):
    asked = allow(monkeypatch, 64, 10**6)
    assert connections_that_fit(SETTINGS) == 100
    ((needed, hard),) = asked
    assert (needed > 100, hard) == (True, 10**6)
    # With what was asked for, and without a limit, nothing is asked again.
    for enough in (needed, resource.RLIM_INFINITY):
        asked = allow(monkeypatch, enough, enough)
        assert connections_that_fit(SETTINGS) == 100
        assert asked == []
    allow(monkeypatch, 64, needed - 60)
    assert connections_that_fit(SETTINGS) == 90


def test_every_connection_may_hold_a_request_that_waits_to_be_measured(monkeypatch):
    """Its own descriptor and five files; uploads are connections too, and count no further."""
    wanted = []
    for connections, uploads in ((100, 1), (101, 1), (101, 500)):
        asked = allow(monkeypatch, 64, 10**6)
        settings = Settings(workers=1, queue=2, connections=connections, uploads=uploads)
        assert connections_that_fit(settings) == connections
        ((needed, _),) = asked
        wanted.append(needed)
    assert wanted == [wanted[0], wanted[0] + 6, wanted[0] + 6]


def test_where_not_one_connection_fits_the_service_says_what_it_needs(monkeypatch):
    allow(monkeypatch, 64, 64)
    with pytest.raises(StartError, match="64 open files are allowed") as refusal:
        connections_that_fit(SETTINGS)
    (needed,) = map(int, re.findall(r"(\d+) needed", str(refusal.value)))
    allow(monkeypatch, needed, needed)
    assert connections_that_fit(SETTINGS) == 1
