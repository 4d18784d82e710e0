"""Cap the memory of a block of code, such as a decoder that trusts its input."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import LimitError

try:
    import resource
except ImportError:  # Windows has no such limit.
    resource = None  # type: ignore[assignment]

_STATM = Path("/proc/self/statm")


@contextmanager
def memory_cap(allowed: int, text: str, slack: int = 0) -> Iterator[None]:
    """Let the process grow by at most `allowed` and `slack` bytes of address space.

    Linux only; other systems have no cap. Raises LimitError, which says `text`.
    """
    try:
        with _capped(allowed + slack):
            yield
    except MemoryError as error:
        # Where it stopped is not known; it asked for a byte more than was left, or for many.
        raise LimitError(text, limit="memory", allowed=allowed, found=allowed + 1) from error


@contextmanager
def _capped(extra: int) -> Iterator[None]:
    if resource is None or not _STATM.exists():
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    ceiling = int(_STATM.read_text().split()[0]) * resource.getpagesize() + extra
    lower = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min([ceiling, *lower]), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
