"""The command `pns`."""

from .commands import app, main

__all__ = ["app", "main"]
