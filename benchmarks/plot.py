"""Time against faces on logarithmic axes, from results.json."""

from __future__ import annotations

from pathlib import Path
from typing import Any

# Ours first; peers in greys and muted colours behind them.
OURS = ("#c2410c", "#fb923c", "#7c3aed", "#c4b5fd")
PEERS = ("#475569", "#0369a1", "#64748b", "#a16207", "#94a3b8", "#4d7c0f", "#9ca3af")
MARKERS = "osD^vP*"


def plot_results(result: dict[str, Any], path: Path) -> None:
    """Draw one line a method: warm seconds for a level of the closed mesh."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    cases = [c for c in result["cases"] if c["order"] == "closed" and c["levels"] == 1]
    names = list(dict.fromkeys(name for case in cases for name in case["methods"]))
    figure, axes = plt.subplots(figsize=(7.2, 4.6), layout="constrained")
    ours = peers = 0
    for name in names:
        points = [(c["faces"], c["methods"][name]["median"]) for c in cases if name in c["methods"]]
        x, y = zip(*sorted(points), strict=True)
        if name.startswith("pns "):
            axes.loglog(
                x, y, color=OURS[ours % len(OURS)], marker="o", lw=2.4, label=name, zorder=3
            )
            ours += 1
        else:
            colour, marker = PEERS[peers % len(PEERS)], MARKERS[peers % len(MARKERS)]
            axes.loglog(x, y, color=colour, marker=marker, ms=4, lw=1.1, label=f"{name} (Loop)")
            peers += 1
    axes.set_xlabel("faces before the level")
    axes.set_ylabel("seconds, arrays to arrays")
    axes.set_title(f"One level of a closed mesh, {result['machine']['threads']} threads")
    axes.grid(True, which="major", color="#e2e8f0")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8, ncols=2)
    figure.savefig(path, dpi=160)
    plt.close(figure)
