"""A soak: honest clients all the time, one attack after another beside them."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection

from tests.soak import honest
from tests.soak.attacks import ATTACKS, Attack, Target
from tests.soak.process import Held, held_by
from tests.soak.samples import large_body, samples, small_sample
from tests.soak.tally import Tally

Address = tuple[str, int]
QUIET = "quiet"


@dataclass(frozen=True)
class Soaked:
    """What a soak found."""

    tally: Tally
    before: Held | None
    after: Held | None


def soak(
    address: Address,
    seconds: float,
    pid: int | None = None,
    attacks: dict[str, Attack] = ATTACKS,
    say: Callable[[str], None] = print,
    *,
    one_source: bool = False,
) -> Soaked:
    """Run for about so many seconds: a tenth each in quiet before and after, the rest in attacks.

    Attackers have addresses of their own, or (`one_source`) none but the honest clients'. Memory is
    compared between the two quiet times, with the honest clients at work in both.
    """
    honest.wait_until_ready(address)
    tally, ended = Tally(), threading.Event()
    known = samples()
    small = small_sample()
    clients = [
        lambda: honest.honest(address, known, tally, ended, 1),
        lambda: honest.honest(address, known, tally, ended, 2),
        lambda: honest.honest(address, [small], tally, ended, 3),
        lambda: honest.large(address, large_body(), tally, ended),
        lambda: honest.slow(address, known, tally, ended),
        lambda: honest.leaving(address, known, tally, ended, 4),
    ]
    threads = [threading.Thread(target=client) for client in clients]
    with ExitStack() as stack:
        stack.callback(_end, ended, threads)
        stack.enter_context(_probing(address, tally))
        for thread in threads:
            thread.start()
        quiet, each = seconds / 10, 0.8 * seconds / max(len(attacks), 1)
        ended.wait(quiet)
        before = None if pid is None else held_by(pid)
        for name, attack in attacks.items():
            say(f"… {name}")
            with _under(attack, Target(address, one_source)):
                tally.phase = name
                ended.wait(each)
            tally.phase = QUIET
        ended.wait(quiet)
        after = None if pid is None else held_by(pid)
    return Soaked(tally, before, after)


def _end(ended: threading.Event, threads: list[threading.Thread]) -> None:
    ended.set()
    for thread in threads:
        thread.join()


@contextmanager
def _under(attack: Attack, target: Target) -> Iterator[None]:
    """In a process of its own: its threads must not keep the honest clients' waiting."""
    context = multiprocessing.get_context("spawn")
    over = context.Event()
    process = context.Process(target=attack, args=(target, over))
    process.start()
    try:
        yield
    finally:
        over.set()
        process.join()


@contextmanager
def _probing(address: Address, tally: Tally) -> Iterator[None]:
    """The probe, in a process of its own: what it measures is the service, not its clients."""
    context = multiprocessing.get_context("spawn")
    over, (receiver, sender) = context.Event(), context.Pipe(duplex=False)
    process = context.Process(target=honest.probe, args=(address, over, sender))
    process.start()
    reader = threading.Thread(target=_collect, args=(receiver, tally))
    reader.start()
    try:
        yield
    finally:
        over.set()
        process.join()
        sender.close()
        reader.join()
        receiver.close()


def _collect(receiver: Connection, tally: Tally) -> None:
    while True:
        try:
            status, seconds = receiver.recv()
        except EOFError:
            return
        tally.took("/healthz", seconds)
        tally.answer("/healthz", status)
        if status != 200:
            tally.mistake(f"/healthz: {status or 'no answer'}, beside {tally.phase}")
