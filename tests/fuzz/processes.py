"""Share a run among processes: a crash ends one of them, and is found out."""

import logging
import multiprocessing
import tempfile
from pathlib import Path

from tests.fuzz.run import Tally, run
from tests.fuzz.seeds import seeds


def in_processes(jobs):
    """Each job in a process of its own; one that dies leaves its input behind and a fault."""
    context = multiprocessing.get_context("spawn")
    running = []
    for job in jobs:
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(sender, *job))
        process.start()
        sender.close()
        running.append((process, receiver, job))
    tallies = []
    for process, receiver, job in running:
        try:
            tally = receiver.recv()
        except EOFError:
            process.join()
            body = Path(tempfile.gettempdir()) / f"pns-fuzz-{job[3]}.bin"
            body.write_bytes(job[4].read_bytes() if job[4].exists() else b"")
            tally = Tally(faults=[("?", job[3], f"exit {process.exitcode}; the input is {body}")])
        process.join()
        tallies.append(tally)
    return tallies


def _work(sender, folder, count, seconds, start, kept):
    # A library's warnings about each malformed body are no news here.
    logging.disable(logging.WARNING)
    sender.send(run(seeds(folder), count, seconds, start, kept))
