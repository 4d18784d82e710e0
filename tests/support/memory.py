"""Memory that a piece of work takes."""

import tracemalloc


def most_of(work, *arguments, **named):
    """What the work returns, and the most bytes that it held meanwhile."""
    tracemalloc.start()
    try:
        made = work(*arguments, **named)
        return made, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
