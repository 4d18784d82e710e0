"""`python -m benchmarks.flame`: a flame graph of each goal's run, docs/flame-*.png.

py-spy, in the peers' environment (make bench), looks at the Python frames 100 times a second, on
all threads that are not idle. A compiled kernel counts for the line that calls it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.workloads import WORKLOADS

ROOT = Path(__file__).resolve().parents[1]
PY_SPY = ROOT / ".venv-bench" / "bin" / "py-spy"
# Stacks are drawn from the frame that repeats the work; what it cost to get there is left out.
ROOT_FRAME = "repeat (benchmarks/workloads.py"
WORKER_FRAME = "drain ("
NARROWEST, LABELLED = 0.004, 0.045
COLOURS = ("#fdba74", "#fb923c", "#fcd34d", "#fca5a5")


def main(
    names: Annotated[list[str] | None, typer.Argument(help=", ".join(WORKLOADS))] = None,
    seconds: Annotated[float, typer.Option(help="how long each run is looked at")] = 8.0,
) -> None:
    """Draw the runs that are named, or all."""
    for name in names or WORKLOADS:
        run = [sys.executable, "-m", "benchmarks.workloads", name, str(seconds)]
        with tempfile.TemporaryDirectory() as folder:
            stacks = Path(folder) / "stacks"
            look = [str(PY_SPY), "record", "--rate", "100", "--format", "raw"]
            subprocess.run([*look, "--output", str(stacks), "--", *run], cwd=ROOT, check=True)
            counted = read_stacks(stacks.read_text())
        draw(counted, WORKLOADS[name].__doc__ or name, ROOT / "docs" / f"flame-{name}.png")


def read_stacks(text: str) -> Counter[tuple[str, ...]]:
    """Read how many samples each stack has, outermost frame first, of the repeated work alone."""
    counted: Counter[tuple[str, ...]] = Counter()
    for line in text.splitlines():
        stack, _, samples = line.rpartition(" ")
        frames = stack.split(";")
        starts = [i for i, frame in enumerate(frames) if frame.startswith(ROOT_FRAME)]
        starts += [i for i, frame in enumerate(frames) if frame.startswith(WORKER_FRAME)]
        if starts:
            counted[tuple(frames[starts[0] + 1 :])] += int(samples)
    return counted


def draw(counted: Counter[tuple[str, ...]], title: str, path: Path) -> None:
    """Draw boxes as wide as the share of samples that pass through a frame, callers below."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    depth = max(len(stack) for stack in counted)
    figure, axes = plt.subplots(figsize=(11, 0.24 * depth + 0.8), layout="constrained")
    total = sum(counted.values())

    def place(stacks: Counter[tuple[str, ...]], left: float, level: int) -> None:
        inside: dict[str, Counter[tuple[str, ...]]] = {}
        for stack, samples in stacks.items():
            if stack:
                inside.setdefault(stack[0], Counter())[stack[1:]] += samples
        for frame, rest in sorted(inside.items()):
            width = sum(rest.values()) / total
            if width >= NARROWEST:
                colour = COLOURS[hash_of(frame) % len(COLOURS)]
                axes.barh(level, width, 0.94, left, color=colour, edgecolor="white", lw=0.4)
                if width >= LABELLED:
                    label = f"{short(frame)} {width:.0%}"[: int(150 * width)]
                    axes.text(left + 0.002, level, label, va="center", fontsize=6.5)
                place(rest, left, level + 1)
            left += width

    place(counted, 0.0, 0)
    axes.set(xlim=(0, 1), yticks=[], xticks=[], title=title)
    axes.spines[:].set_visible(False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def short(frame: str) -> str:
    """Return a frame's function, and its file without folders."""
    function, _, place = frame.partition(" (")
    return f"{function} ({Path(place.rstrip(')')).name})"


def hash_of(frame: str) -> int:
    """Return the same number for a frame in every run."""
    return sum(map(ord, frame))


if __name__ == "__main__":
    typer.run(main)
