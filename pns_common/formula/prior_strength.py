"""How much of the prior a mesh gets: more where its faces are even.

    s = s₀ + (s₁ − s₀) t(σ/μ) t(F)

σ/μ is the standard deviation over the mean of the lengths of all faces' sides, F how many faces
there are, t goes from 1 to 0 over ``EVEN``, and from 0 to 1 over ``ENOUGH``. s₀ and s₁ stand on a
model's card (``prior_strength``, ``even_prior_strength``).

The prior undoes what Loop's limit takes off, which is right where vertices lie on the surface that
a mesh stands for. Where a collapse has put them outside of it, it is too much. One ring does not
show which it is (regressions of heights on slopes do not tell such meshes from the same ones laid
onto the surface), but the whole does: collapses that follow an error leave faces of all sizes (σ/μ
of .39 and more on all validation meshes, .53 in the median), collapses of shortest edges and
clustering even ones (.18 and more, .24 in the median), as do remeshers and regular samples. A
handful of faces says nothing.

At 1 the prior undoes the whole of it (formula/prior.py); a hundred times as much means nothing, and
far beyond its squares leave the floats. So much is refused.
"""

from __future__ import annotations

from pns_common.geometry.side_lengths import SideLengths

# σ/μ up to which a mesh is even, and from which on it is not; faces likewise.
EVEN = (0.28, 0.34)
ENOUGH = (32, 128)
# Of any prior, given or on a card.
HIGHEST_STRENGTH = 100.0


def prior_strength(uneven: float, even: float, sides: SideLengths) -> float:
    """Return s of a mesh; ``uneven`` is s₀ and ``even`` s₁."""
    from_even = _way(sides.variation, *EVEN)
    return uneven + (even - uneven) * (1 - from_even) * _way(sides.faces, *ENOUGH)


def _way(value: float, begin: float, end: float) -> float:
    """Return how far a value is from ``begin`` to ``end``, 0 … 1."""
    return min(max((value - begin) / (end - begin), 0.0), 1.0)
