"""T8, planar spectral inheritance, and lifted stars, of which no theorem speaks.

At a flat k-star the scheme's linearisation is that of its base. Off the plane the signed Reif
margin is a diagnostic.
"""

from collections.abc import Sequence

import numpy as np

from pns_common import Scheme
from train.certificates.bases import LOOP, Base
from train.certificates.subject import Certificate, Kind, Subject, worst
from train.refining import refine
from train.spectra.spectrum import (
    SPOKE,
    TANGENT_COUNT,
    closed_star,
    follow_lift,
    jacobian,
    perturbed_stars,
    refined_inner,
    reif_gap,
    without_translations,
)

# In spokes: what is of second order in the lift is then below rounding.
TINY = 1e-8

# In spokes, for eigenvalues: central differences err by its square times the third derivative,
# which a gate of order two does not keep small, and by the rounding of positions over it.
FINE = 5e-7

FLAT = 1e-6
EIGENVALUE = 1e-9
# The same for scale-free rules: their gates, tanh(c_v x), are sharper, and the second and third
# derivatives that finite differences see with them. A gate with a kink shows as 1e-2.
FLAT_BY_SHARPNESS, SHARPER_EIGENVALUE = 1e-7, 1e-6


def planar_spectrum(subject: Subject, valences: Sequence[int]) -> list[Certificate]:
    """Certify T8 for each valence: the derivative, the tangent eigenvalues and the Reif gap."""
    deviations, tangents, gaps = [], [], []
    flat, finest = FLAT, EIGENVALUE
    base, card = subject.base, subject.learned_once
    if card is not None:
        flat = FLAT_BY_SHARPNESS * (card.vertex_gate_sharpness or 0.0)
        finest = SHARPER_EIGENVALUE
    for valence in valences:
        place = f"k = {valence}"
        size = spectrum(subject.exact, valence, base)
        tangent = np.abs(size[:TANGENT_COUNT] - base.eigenvalue(valence)).max()
        deviations.append((derivative_of_departure(subject.exact, valence, base), place))
        tangents.append((float(tangent), place))
        gaps.append((abs(reif_gap(size) - base.gap(valence)), place))
    rows = (
        (f"derivative of the departure from {base.name}", deviations, flat),
        (f"tangent eigenvalues against {base.formula}", tangents, finest),
        (f"Reif gap against {base.name}'s", gaps, finest),
    )
    return [
        Certificate("T8", f"planar spectrum: {name}", *_value_high(measured, bound))
        for name, measured, bound in rows
    ]


def spectrum(scheme: Scheme, valence: int, base: Base = LOOP) -> np.ndarray:
    """Return |λ| of the linearisation at a flat star, largest first, translations left out."""
    star = closed_star(scheme, valence, FINE, base.star)(0.0)
    matrix = without_translations(jacobian(scheme, star, FINE))
    return np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]


def derivative_of_departure(scheme: Scheme, valence: int, base: Base = LOOP) -> float:
    """Return the largest ‖S − S_base‖ / ε of a flat star moved by a tiny ε in any inner coordinate.

    One-sided: a gate with a kink at flat faces cancels in central differences, and automatic
    differentiation calls its slope 0 too.
    """
    star, step = closed_star(scheme, valence, TINY, base.star)(0.0), TINY * SPOKE
    mesh, count = perturbed_stars(star, step)
    refined, plain = (
        refined_inner(star, refine(mesh, rule, 1, 1.0).mesh.vertices, 2 * count)
        for rule in (scheme, base.scheme)
    )
    return float(np.abs(refined - plain).max()) / step


def _value_high(measured: list[tuple[float, str]], high: float) -> tuple[float, float, float, str]:
    value, place = worst(measured)
    return value, -np.inf, high, place


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
