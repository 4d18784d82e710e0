"""The slope of the Reif margin: by each entry of the matrix whose spectrum it is taken from."""

import numpy as np
from jaxtyping import Float

from train.spectra.spectrum import Spectrum


def margin_gradient(spectrum: Spectrum) -> Float[np.ndarray, "L L"]:
    """Return the derivative of the margin by each entry of the matrix.

    dλ = l dJ r for the left and right eigenvectors of a simple eigenvalue, l r = 1.
    """
    tangent, other = spectrum.least_tangent, spectrum.largest_other
    return _size_gradient(spectrum, tangent) - _size_gradient(spectrum, other)


def _size_gradient(spectrum: Spectrum, index: int) -> Float[np.ndarray, "L L"]:
    """Return d|λ|."""
    value = spectrum.values[index]
    return np.real(np.conj(value) / max(abs(value), 1e-300) * _gradient(spectrum, index))


def _gradient(spectrum: Spectrum, index: int) -> np.ndarray:
    """Return dλ, complex."""
    return np.outer(spectrum.left[index], spectrum.right[:, index])
