"""The slope of the Reif margin: by each entry of the matrix whose spectrum it is taken from."""

import numpy as np
from jaxtyping import Float

from train.spectra.spectrum import Spectrum

PAIRED = 1e-9
"""How exactly, relatively, two eigenvalues of a real matrix are conjugate."""


def margin_gradient(spectrum: Spectrum) -> Float[np.ndarray, "L L"]:
    """Return the derivative of the margin by each entry of the matrix.

    dλ = l dJ r for the left and right eigenvectors of a simple eigenvalue, l r = 1.
    """
    tangent, other = spectrum.least_tangent, spectrum.largest_other
    return _size_gradient(spectrum, tangent) - _size_gradient(spectrum, other)


def separation(spectrum: Spectrum) -> tuple[float, Float[np.ndarray, "L L"]]:
    """Return the margin and its derivative, and below 0 how far a shared pair is from parting.

    Where a tangent and another eigenvalue have met and left the real line as a conjugate pair, both
    have one size, and nothing that changes it parts them. What does is to bring the pair back to
    the real line: the value is then −2 |Im λ|, which is 0 like the margin where they meet.
    """
    shared = shared_pair(spectrum)
    if shared is None:
        return spectrum.margin, margin_gradient(spectrum)
    imaginary = complex(spectrum.values[shared]).imag
    slope = -2 * np.sign(imaginary) * np.imag(_gradient(spectrum, shared))
    return -2 * abs(imaginary), slope


def shared_pair(spectrum: Spectrum) -> int | None:
    """Return the tangent furthest off the real line whose conjugate is no tangent, if any."""
    values, tangent = spectrum.values, spectrum.tangent
    others = values[~tangent]
    shared = [
        int(index)
        for index in np.flatnonzero(tangent & (np.imag(values) != 0))
        if np.abs(others - np.conj(values[index])).min() <= PAIRED * abs(values[index])
    ]
    return max(shared, key=lambda index: abs(complex(values[index]).imag), default=None)


def _size_gradient(spectrum: Spectrum, index: int) -> Float[np.ndarray, "L L"]:
    """d|λ|."""
    value = spectrum.values[index]
    return np.real(np.conj(value) / max(abs(value), 1e-300) * _gradient(spectrum, index))


def _gradient(spectrum: Spectrum, index: int) -> np.ndarray:
    """dλ, complex."""
    return np.outer(spectrum.left[index], spectrum.right[:, index])
