"""Text from files, as a terminal may show it."""

from __future__ import annotations


def printable(text: str) -> str:
    """Return a line as a terminal may show it: a file's name or content may hold its commands."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
