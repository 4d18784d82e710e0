"""Growth of time and memory, as docs/scale.md shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def plot(known: dict[str, Any], picture: Path) -> None:
    """Draw the growth with faces and with parts, as docs/scale.md shows it."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot as plt

    by_size = sorted(
        (run for name, run in known.items() if name.startswith("large")), key=lambda r: r["faces"]
    )
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    faces = [r["faces"] for r in by_size]
    axes[0].loglog(faces, [sum(r["seconds"].values()) for r in by_size], "o-", label="wall")
    axes[0].loglog(faces, [r["processor_seconds"] for r in by_size], "s--", label="processor")
    axes[0].set(xlabel="faces made", ylabel="seconds", title="Time, two workers")
    axes[1].semilogx(faces, [r["worker_bytes"] / 2**20 for r in by_size], "o-", label="a worker")
    axes[1].semilogx(faces, [r["driver_bytes"] / 2**20 for r in by_size], "s--", label="the driver")
    axes[1].set(xlabel="faces made", ylabel="MiB resident", title="Memory", ylim=0)
    cut = sorted(
        (run for name, run in known.items() if name.startswith("parts")), key=lambda r: r["parts"]
    )
    parts = [r["parts"] for r in cut]
    memory = axes[2].twinx()
    seconds = [r["processor_seconds"] for r in cut]
    resident = [r["worker_bytes"] / 2**20 for r in cut]
    axes[2].semilogx(parts, seconds, "o-", base=2)
    memory.semilogx(parts, resident, "s--", base=2, color="C1")
    title = f"Parts of {cut[0]['faces'] / 1e6:.1f} M faces"
    axes[2].set(xlabel="parts", ylabel="processor seconds (circles)", title=title)
    axes[2].set_ylim(0, 1.5 * max(seconds))
    memory.set_ylabel("MiB resident, a worker (squares)")
    memory.set_ylim(0, 1.2 * max(resident))
    for axis in axes[:2]:
        axis.legend()
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.savefig(picture, dpi=110)
