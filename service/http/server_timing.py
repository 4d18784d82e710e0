"""Write the seconds of a job's stages as a header."""

from __future__ import annotations


def server_timing(seconds: dict[str, float]) -> str:
    """Return the value of `Server-Timing`: milliseconds by stage."""
    return ", ".join(f"{stage};dur={1000 * value:.1f}" for stage, value in seconds.items())
