"""Feed malformed bodies to the job's own path, and keep count of what became of them."""

from __future__ import annotations

import random
import time
from collections import Counter
from dataclasses import dataclass, field

from benchmarks.memory import peak_mib, reset_peak
from pns_common.errors import MeshError
from service.bodies.uploads import sent
from service.errors import ServiceError
from service.meshfiles.convert import converted
from service.options import Limits, Options
from tests.fuzz.mutate import mutated

MIB = 2**20
# What a malformed file leaves of itself is written in every way.
COMPRESS = ("none", "none", "draco", "meshopt")
LIMITS = Limits(max_faces=20_000, max_memory_bytes=64 * MIB)
# The promise: no input takes more than its limit and this.
ALLOWANCE = 64 * MIB


@dataclass
class Tally:
    """The counts of a run.

    Attributes:
        run: bodies tried.
        outcomes: how many were refined, or refused with each code.
        peak: MiB at the worst, above what stood before.
        faults: (seed, number, what went wrong) of bodies that broke a promise.
    """

    run: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    peak: float = 0.0
    faults: list[tuple[str, int, str]] = field(default_factory=list)


def run(seeds, count, seconds, start, kept):
    """Try `count` bodies, or as many as fit into `seconds`.

    Body `number` follows from its number alone, whatever ran before: (start + number) names it. The
    body under way is kept in a file, so that even a crash leaves its cause behind.
    """
    tally = Tally()
    for seed in seeds:
        outcome(seed, seed.body)
    reset_peak()
    base = peak_mib()
    deadline = time.monotonic() + seconds
    for number in range(start, start + count):
        if time.monotonic() > deadline:
            break
        rng = random.Random(number)
        seed = rng.choice(seeds)
        body = mutated(seed, rng)
        if kept is not None:
            kept.write_bytes(body)
        try:
            code = outcome(seed, body, rng.choice(COMPRESS))
        except Exception as error:
            code = "fault"
            tally.faults.append((seed.name, number, repr(error)))
        tally.run += 1
        tally.outcomes[code] += 1
        used = peak_mib() - base
        if used > tally.peak:
            tally.peak = used
            if used * MIB > LIMITS.max_memory_bytes + ALLOWANCE:
                tally.faults.append((seed.name, number, f"{used:.0f} MiB"))
                reset_peak()
    return tally


def outcome(seed, body, compress="none"):
    """ "refined", or the code of the refusal. Any other exception is a fault."""
    options = Options(levels=1, scheme="loop", compress=compress)
    try:
        upload = sent(body, seed.content_type, LIMITS)
        converted(upload.data, upload.kind, "glb", options, None, LIMITS, siblings=upload.siblings)
    except ServiceError as refusal:
        if not 400 <= refusal.status < 500:
            raise
        return refusal.code
    except MeshError:
        return "mesh"
    return "refined"
