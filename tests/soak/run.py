"""A soak: honest clients all the time, one attack after another beside them."""

from __future__ import annotations

import multiprocessing
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial

from tests.soak import honest
from tests.soak.attacks import ATTACKS, Target
from tests.soak.process import Held, least_held_by
from tests.soak.samples import large_body, samples, small_sample
from tests.soak.tally import Tally

Address = tuple[str, int]
QUIET = "quiet"
# What an attack may take to strike for the first time, where a job has to be done before.
PATIENCE = 120


@dataclass(frozen=True)
class Soaked:
    """The result of a soak."""

    tally: Tally
    before: Held | None
    after: Held | None


def soak(
    address, seconds, pid=None, attacks=ATTACKS, say=print, *, warm_seconds=0.0, one_source=False
):
    """Run for about so many seconds: a tenth each in quiet before and after, the rest in attacks.

    Attackers have addresses of their own, or (`one_source`) none but the honest clients'. Memory is
    compared between the two quiet times: the least that each process holds, between the honest
    clients' jobs. A process grows until it has met all that there is, and what counts is what comes
    after: `warm_seconds` of every format and attack come before all that.
    """
    honest.wait_until_ready(address)
    tally, ended = Tally(), threading.Event()
    known = samples()
    small = small_sample()
    clients = [
        *(partial(honest.honest, address, known, tally, ended, seed) for seed in (1, 2, 3)),
        *(partial(honest.honest, address, [small], tally, ended, seed) for seed in (4, 5, 6)),
        lambda: honest.large(address, large_body(), tally, ended),
        lambda: honest.slow(address, known, tally, ended),
        lambda: honest.leaving(address, known, tally, ended, 7),
    ]
    threads = [threading.Thread(target=client) for client in clients]
    with ExitStack() as stack:
        stack.callback(_end, ended, threads)
        stack.enter_context(_probing(address, tally, excused=503 if one_source else 200))
        for thread in threads:
            thread.start()
        attack_for = stack.enter_context(_attacking(address, one_source))
        each = 1 / max(len(attacks), 1)
        if warm_seconds:
            say("… warming")
            tally.phase = "warming"
            for attack in attacks.values():
                attack_for(attack, warm_seconds * each)
            tally.phase = QUIET
        before = _quiet(seconds / 10, pid)
        for name, attack in attacks.items():
            say(f"… {name}")
            tally.phase = name
            attack_for(attack, 0.8 * seconds * each)
            tally.phase = QUIET
        after = _quiet(seconds / 10, pid)
    return Soaked(tally, before, after)


def _quiet(seconds, pid):
    """Let the honest clients alone; what the service holds meanwhile, if its process is known."""
    if pid is not None:
        return least_held_by(pid, seconds)
    time.sleep(seconds)
    return None


def _end(ended, threads):
    ended.set()
    for thread in threads:
        thread.join()


@contextmanager
def _attacking(address, one_source):
    """Attacks for so many seconds each, and for as long as they take to strike.

    They run in a process of their own, so that their threads keep no honest client waiting; in one
    for all, so that their seconds are not those that a process takes to start.
    """
    context = multiprocessing.get_context("spawn")
    over, struck, (here, there) = context.Event(), context.Event(), context.Pipe()
    target = Target(address, one_source, struck)
    process = context.Process(target=_attack_in_turn, args=(target, over, there))
    process.start()
    there.close()

    def attack_for(attack, seconds):
        over.clear()
        struck.clear()
        here.send(attack)
        here.poll(seconds)
        has_struck = struck.wait(PATIENCE)
        over.set()
        try:
            here.recv()
        except EOFError:
            raise RuntimeError("an attack failed") from None
        if not has_struck:
            raise RuntimeError("an attack never struck")

    try:
        yield attack_for
    finally:
        over.set()
        here.close()
        process.join()


def _attack_in_turn(target, over, orders):
    """Each attack that is sent, until it is over; then say so."""
    with suppress(EOFError):
        while True:
            attack = orders.recv()
            attack(target, over)
            orders.send(None)


@contextmanager
def _probing(address, tally, excused):
    """The probe, in a process of its own: what it measures is the service, not its clients.

    An `excused` status is no mistake: of one source, attackers have the probe's own slots.
    """
    context = multiprocessing.get_context("spawn")
    over, (receiver, sender) = context.Event(), context.Pipe(duplex=False)
    process = context.Process(target=honest.probe, args=(address, over, sender))
    process.start()
    reader = threading.Thread(target=_collect, args=(receiver, tally, excused))
    reader.start()
    try:
        yield
    finally:
        over.set()
        process.join()
        sender.close()
        reader.join()
        receiver.close()


def _collect(receiver, tally, excused):
    while True:
        try:
            status, seconds = receiver.recv()
        except EOFError:
            return
        tally.took("/healthz", seconds)
        tally.answer("/healthz", status)
        if status not in (200, excused):
            tally.mistake(f"/healthz: {status or 'no answer'}, beside {tally.phase}")
