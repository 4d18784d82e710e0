"""Memory that a piece of work takes."""

import tracemalloc


def most_of(work, *arguments, **named):
    """Return the result of some work, and the most bytes that it held meanwhile."""
    tracemalloc.start()
    try:
        made = work(*arguments, **named)
        return made, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
