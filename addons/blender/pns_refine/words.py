"""Sentences of the interface. Knows no Blender: lengths come as texts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


def certificate(
    report: dict[str, Any], farthest: float, length: Callable[[float], str]
) -> list[str]:
    """Tell what a report promises and measured; ``length`` words a length in the mesh's units."""
    levels, adaptive = report["levels"], report.get("adaptive")
    if adaptive is not None:
        return _of_goal(report, adaptive, length)
    steps = f"{len(levels)} level" + ("s" if len(levels) > 1 else "")
    if report["scheme"] == "loop":
        return [f"{steps} of Loop, without correction"]
    lines = [f"{steps} of PNS, model {report['model']}, C = {report['budget']:.3g}"]
    lines.append(f"No vertex is farther than {length(farthest)} from the plain scheme's,")
    lines.append(f"no point of the limit surface farther than {length(report['limit_distance'])}")
    bound = report["limit_distance_bound"]
    if bound is not None:
        lines.append(f"Budget and creases allow {length(bound)}")
    worst = max(level["proximity_ratio"]["max"] for level in levels)
    lines.append(f"At most {100 * worst:.0f} % of the allowed correction was used")
    flipped = sum(level["flipped_faces"] for level in levels)
    lines.append("No face is flipped" if not flipped else f"{flipped:,} faces are flipped")
    return lines


def _of_goal(
    report: dict[str, Any], adaptive: dict[str, Any], length: Callable[[float], str]
) -> list[str]:
    rule = "Loop" if report["scheme"] == "loop" else f"PNS, model {report['model']}"
    return [
        f"{adaptive['faces']:,} faces where the surface bends, by {rule}",
        "No point of the smooth surface is farther",
        f"from the face under it than {length(adaptive['distance_max'])}",
    ]


def listed(names: Sequence[str], most: int = 4) -> str:
    """List names in a row; those that are too many are counted."""
    if len(names) <= most:
        return ", ".join(names)
    return ", ".join(names[:most]) + f" and {len(names) - most} more"
