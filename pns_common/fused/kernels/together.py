"""Numbers of some faces or edges, one beside the other: loops over them run on vectors.

What is gathered from all over a mesh does not; so it is gathered first, one by one, and then all
that is computed of it is computed at once, without a branch. A number of one stands TOGETHER after
the one before it, so a compiler knows how far apart they are. The loops run over all TOGETHER, also
where there are fewer, and the last is held again in place of those that are missing: over a count
that it does not know, the compiler fetches number by number, and asks of each place whether it
counts from the end.
"""

from __future__ import annotations

# Faces or edges that are held at once: four vectors of the widest kind. What is held, of up to 42
# numbers each, stays in the first-level cache beside what is gathered; of more it does not.
TOGETHER = 32


def keep(held, k, lane, v):
    """Hold a vector as numbers k … k + 2 of a face or an edge."""
    at = k * TOGETHER + lane
    held[at] = v[0]
    held[at + TOGETHER] = v[1]
    held[at + 2 * TOGETHER] = v[2]


def kept(held, k, lane):
    """Return such a vector."""
    at = k * TOGETHER + lane
    return held[at], held[at + TOGETHER], held[at + 2 * TOGETHER]
