"""`python -m tests.soak`: honest, slow, leaving and hostile clients at one service, over hours.

python -m tests.soak                            # ten minutes, a service of its own
python -m tests.soak --minutes 1440
python -m tests.soak --address 127.0.0.1:8000 --one-source   # one that runs, a container's say

A service of its own stands behind the proxy of deploy/ where there is nginx. From one source the
attackers share the honest clients' slots.
"""

from __future__ import annotations

import tempfile
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated

import typer

from tests.soak.process import faults_in, lines_of, started
from tests.soak.run import Soaked, soak

MOST_WARM_SECONDS = 600.0


def main(
    minutes: Annotated[float, typer.Option(help="how long, about")] = 10.0,
    address: Annotated[str | None, typer.Option(help="HOST:PORT of one that runs")] = None,
    pid: Annotated[int | None, typer.Option(help="its process, to see what it holds")] = None,
    one_source: Annotated[
        bool, typer.Option("--one-source", help="attack from no address of its own")
    ] = False,
) -> None:
    """Soak a service; fails on a wrong answer, a fault, or a line that is no JSON."""
    if address is not None:
        host, _, port = address.rpartition(":")
        if not ip_address(host).is_loopback:
            raise typer.BadParameter("it attacks: this machine's own addresses alone")
        print_(_soaked((host, int(port)), minutes, pid, one_source=one_source))
        return
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        with started(log) as (where, process):
            soaked = _soaked(where, minutes, process, one_source=one_source)
        lines = lines_of(log)
        longest = max(len(str(line)) for line in lines)
        typer.echo(f"{len(lines)} log lines, all JSON, the longest of {longest} characters")
        for line in faults_in(log):
            typer.echo(line, err=True)
    print_(soaked)


def _soaked(
    address: tuple[str, int], minutes: float, pid: int | None, *, one_source: bool
) -> Soaked:
    warm = min(0.2 * 60 * minutes, MOST_WARM_SECONDS)
    seconds = 60 * minutes - warm
    return soak(address, seconds, pid, warm_seconds=warm, one_source=one_source)


def print_(soaked: Soaked) -> None:
    """The figures, and the verdict."""
    tally = soaked.tally
    answers = ", ".join(f"{name}: {count}" for name, count in sorted(tally.answers.items()))
    typer.echo(f"answers  {answers}")
    for what in ("/healthz", "small job", "job"):
        for phase, (count, p50, p99, longest) in tally.percentiles(what).items():
            typer.echo(
                f"{what:>9} beside {phase:<18} {count:>6} p50 {p50:7.1f} ms  p99 {p99:7.1f} ms  "
                f"longest {longest:7.1f} ms"
            )
    if soaked.before is not None and soaked.after is not None:
        before, after = soaked.before, soaked.after
        typer.echo(
            f"memory {before.mebibytes:.0f} -> {after.mebibytes:.0f} MiB "
            f"({after.mebibytes / before.mebibytes - 1:+.1%}), "
            f"descriptors {before.descriptors} -> {after.descriptors}, "
            f"processes {before.processes} -> {after.processes}"
        )
    faults = tally.faults()
    typer.echo(f"wrong answers {len(tally.wrong)}, 5xx but 503 {faults.total()}")
    for what in tally.wrong[:20]:
        typer.echo(what, err=True)
    if tally.wrong or faults:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
