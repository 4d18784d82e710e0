"""Off the plane no theorem speaks: the signed Reif margin of lifted stars, as a diagnostic."""

from collections.abc import Sequence

import numpy as np

from train.certificates.certificate import Certificate, Kind
from train.certificates.subject import Subject
from train.spectra.spectrum import follow_lift

# Lift, in spokes.
HIGHEST = 0.4

LIFTS = tuple(np.linspace(0, HIGHEST, 9).tolist())


def lifted_stars(subject: Subject, valences: Sequence[int]) -> list[Certificate]:
    """Measure the least margin over valences at lift 0.4, and the largest |λ|, which 1 bounds."""
    followed = [(follow_lift(subject.exact, valence, LIFTS)[-1], valence) for valence in valences]
    least, at_least = min(followed, key=lambda entry: entry[0].margin)
    largest, at_largest = max(followed, key=lambda entry: entry[0].largest)
    below_one = float(np.nextafter(1, 0))
    return [
        Certificate(
            "stars",
            f"Reif margin at lift {HIGHEST:g}",
            least.margin,
            where=f"k = {at_least}",
            kind=Kind.DIAGNOSTIC,
        ),
        Certificate(
            "stars",
            f"largest |λ| at lift {HIGHEST:g}",
            largest.largest,
            high=below_one,
            where=f"k = {at_largest}",
            kind=Kind.DIAGNOSTIC,
        ),
    ]
