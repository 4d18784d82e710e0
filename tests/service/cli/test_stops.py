"""A run that is stopped says how to go on, and with a code of its own."""

import io
import signal

import pytest
from rich.console import Console

from service.cli.stops import stoppable


@pytest.fixture
def ctrl_c_interrupts():
    """As at a terminal: what a shell starts in the background ignores SIGINT from its birth."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (signal.SIGINT, KeyboardInterrupt),
        (signal.SIGTERM, SystemExit),
        (signal.SIGHUP, SystemExit),
    ],
)
def test_a_signal_ends_what_is_inside_and_tells_how_to_go_on(number, kind, ctrl_c_interrupts):
    said = io.StringIO()
    with pytest.raises(kind) as stopped, stoppable(Console(file=said)):
        signal.raise_signal(number)
    assert said.getvalue() == "stopped; the same command goes on from here\n"
    assert kind is KeyboardInterrupt or stopped.value.code == 128 + number


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signals_are_afterwards_what_they_were(number):
    before = signal.getsignal(number)
    with stoppable(Console(file=io.StringIO())):
        assert signal.getsignal(number) != before
    assert signal.getsignal(number) == before


def test_what_nohup_has_started_goes_on_when_the_terminal_closes():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stoppable(Console(file=io.StringIO())):
            signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


class ClosedTerminal(io.StringIO):
    def write(self, text):
        raise OSError(5, "Input/output error")


def test_a_terminal_that_closes_ends_what_is_inside_in_order():
    """Its shell tells of it, and the system again; nothing can be drawn on it any more."""
    console, ended = Console(file=ClosedTerminal(), force_terminal=True), []

    def work():
        try:
            signal.raise_signal(signal.SIGHUP)
        finally:
            console.print("half of it is done")
            signal.raise_signal(signal.SIGHUP)
            ended.append("a report")

    with pytest.raises(SystemExit) as stopped, stoppable(console):
        work()
    assert stopped.value.code == 128 + signal.SIGHUP
    assert ended
