"""Cost of a start: processor time of the programs, and the size of what is installed."""

from __future__ import annotations

import resource
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from rich.table import Table

from benchmarks.contest import ROOT, as_installed

RUNS = 5
# Parts of an environment that every one has.
TOOLS = ("pip", "setuptools", "pkg_resources", "_distutils_hack")
SITE = "import sysconfig; print(sysconfig.get_path('purelib'))"
WARM = """
import time
from benchmarks.generated import torus
from pns_common import load_model, pns, refine
mesh, scheme, took = torus(1000), pns(load_model()), []
for _ in range(30):
    start = time.process_time()
    refine(mesh, scheme, 2)
    took.append(time.process_time() - start)
print(1000 * sorted(took)[len(took) // 2])
"""


def startup(python: str) -> dict[str, float]:
    """Measure an environment with the service: processor seconds of starts, and MB on disk."""
    pns = str(Path(python).with_name("pns"))
    with tempfile.TemporaryDirectory() as folder:
        part, fine = f"{folder}/part.glb", f"{folder}/fine.glb"
        _said([pns, "example", part])
        starts = {
            "python": [python, "-c", "pass"],
            "import pns_common": [python, "-c", "import pns_common"],
            "pns --help": [pns, "--help"],
            "pns subdivide part.glb": [pns, "subdivide", part, "-o", fine],
        }
        made = {f"{name}, s": median(map(_spent, [one] * RUNS)) for name, one in starts.items()}
    made["1,000 faces, two levels, in a running process, ms"] = float(_said([python, "-c", WARM]))
    site = Path(_said([python, "-c", SITE]).strip())
    parts = (path for path in site.rglob("*") if path.relative_to(site).parts[0] not in TOOLS)
    made["installed, MB"] = sum(p.stat().st_size for p in parts if p.is_file()) / 1e6
    return made


def startup_table(made: dict[str, float]) -> Table:
    """Return the figures as a table."""
    table = Table("at once", "processor")
    for name, value in made.items():
        table.add_row(name, f"{value:.3g}")
    return table


def _spent(command: Sequence[str]) -> float:
    """Run a command; return the processor seconds that it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _said(command)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _said(command: Sequence[str]) -> str:
    done = subprocess.run(
        command, cwd=ROOT, env=as_installed(), capture_output=True, text=True, check=True
    )
    return done.stdout
