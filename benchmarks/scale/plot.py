"""Growth of time and memory, as docs/scale.md shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def plot(known: dict[str, Any], picture: Path) -> None:
    """Growth with faces and with parts, as docs/scale.md shows it."""
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
    axes[2].semilogx(
        parts, [r["processor_seconds"] for r in cut], "o-", base=2, label="processor s"
    )
    axes[2].semilogx(
        parts, [r["worker_bytes"] / 2**26 for r in cut], "s--", base=2, label="a worker, 64 MiB"
    )
    axes[2].set(xlabel="parts", title=f"{cut[0]['faces'] / 1e6:.1f} M faces", ylim=0)
    for axis in axes:
        axis.legend()
        axis.grid(alpha=0.3)
    figure.savefig(picture, dpi=110)
