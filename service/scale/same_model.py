"""Workers refine with the model that their run began with, or not at all."""

from __future__ import annotations

from ..errors import NoModelError


def check_same_model(name: str | None, found: str | None, expected: str | None) -> None:
    """Raise NoModelError where a worker's model is not its driver's, by their hashes."""
    if found != expected:
        raise NoModelError(
            f"{name or 'the default model'}: it is not the model that this run began with; it was "
            "replaced, or is another one on a worker's machine"
        )
