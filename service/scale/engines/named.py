"""The engine that a command line asks for."""

from __future__ import annotations

import os
from collections.abc import Callable

from .local import local
from .on_ray import on_ray
from .work import Engine, R, T, Work


def engine_of(
    work: Work[T, R],
    name: str,
    address: str | None,
    workers: int | None,
    say: Callable[[str], None],
) -> Engine[T, R]:
    """Return the engine of a name, local or ray; an address means Ray, local takes all processors.

    ``say`` is told where Ray's dashboard is.

    Raises:
        InvalidParameter: Ray is not installed.
    """
    if name == "ray" or address is not None:
        return on_ray(work, address, workers, say)
    return local(work, workers or os.cpu_count() or 1)
