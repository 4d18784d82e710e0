"""The slope of the Reif margin: by each entry of the matrix whose spectrum it is taken from."""

import numpy as np
from jaxtyping import Float

from train.spectrum import Spectrum


def margin_gradient(spectrum: Spectrum) -> Float[np.ndarray, "L L"]:
    """Return the derivative of the margin by each entry of the matrix.

    dλ = l dJ r for the left and right eigenvectors of a simple eigenvalue, l r = 1.
    """

    def of_size(index: int) -> Float[np.ndarray, "L L"]:
        value = spectrum.values[index]
        phase = np.conj(value) / max(abs(value), 1e-300)
        return np.real(phase * np.outer(spectrum.left[index], spectrum.right[:, index]))

    return of_size(spectrum.least_tangent) - of_size(spectrum.largest_other)
