"""The error function in double precision, which numpy leaves out.

Source: W. J. Cody, Rational Chebyshev approximations for the error function, Mathematics of
Computation 23 (1969), with the coefficients as published in SPECFUN.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

# |x| below SMALL: erf = x P(x²) / Q(x²); up to LARGE: erfc = exp(−x²) P(|x|) / Q(|x|); above:
# erfc = exp(−x²) / |x| · (1/√π − P(1/x²) / (x² Q(1/x²))). Highest power first.
SMALL, LARGE = 0.46875, 4.0
# From here on erf is 1 in double precision.
ONE = 8.0
# fmt: off
_NEAR = (
    [1.85777706184603153e-1, 3.16112374387056560e0, 1.13864154151050156e2,
     3.77485237685302021e2, 3.20937758913846947e3],
    [1.0, 2.36012909523441209e1, 2.44024637934444173e2, 1.28261652607737228e3,
     2.84423683343917062e3],
)
_MIDDLE = (
    [2.15311535474403846e-8, 5.64188496988670089e-1, 8.88314979438837594e0,
     6.61191906371416295e1, 2.98635138197400131e2, 8.81952221241769090e2,
     1.71204761263407058e3, 2.05107837782607147e3, 1.23033935479799725e3],
    [1.0, 1.57449261107098347e1, 1.17693950891312499e2, 5.37181101862009858e2,
     1.62138957456669019e3, 3.29079923573345963e3, 4.36261909014324716e3,
     3.43936767414372164e3, 1.23033935480374942e3],
)
_FAR = (
    [1.63153871373020978e-2, 3.05326634961232344e-1, 3.60344899949804439e-1,
     1.25781726111229246e-1, 1.60837851487422766e-2, 6.58749161529837803e-4],
    [1.0, 2.56852019228982242e0, 1.87295284992346725e0, 5.27905102951428412e-1,
     6.05183413124413191e-2, 2.33520497626869185e-3],
)
# fmt: on


# Numbers that are worked on at once: as many as stay in a processor's nearest memory.
CHUNK = 4096


def erf(x: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return erf(x), within 1e-15 of the exact value."""
    flat = np.ascontiguousarray(x).reshape(-1)
    answer = np.empty_like(flat)
    for start in range(0, len(flat), CHUNK):
        piece = slice(start, start + CHUNK)
        answer[piece] = _erf(flat[piece])
    return answer.reshape(x.shape)


def _erf(x: np.ndarray) -> np.ndarray:
    size = np.abs(x)
    # Each formula sees its own range alone: clipped, it neither overflows nor divides by zero.
    middle = np.clip(size, SMALL, LARGE)
    answer = np.copysign(1 - np.exp(-middle * middle) * _ratio(_MIDDLE, middle), x)
    near = np.minimum(size, SMALL)
    answer = np.where(size <= SMALL, np.copysign(near, x) * _ratio(_NEAR, near * near), answer)
    if (far := size > LARGE).any():
        answer[far] = np.copysign(1 - _far_tail(np.minimum(size[far], ONE)), x[far])
    return np.where(np.isnan(x), x, answer)


def _far_tail(size: np.ndarray) -> np.ndarray:
    inverse = 1 / size**2
    return np.exp(-size * size) / size * (1 / np.sqrt(np.pi) - inverse * _ratio(_FAR, inverse))


def _ratio(polynomials: tuple[list[float], list[float]], x: np.ndarray) -> np.ndarray:
    above, below = (_polynomial(each, x) for each in polynomials)
    above /= below
    return above


def _polynomial(coefficients: list[float], x: np.ndarray) -> np.ndarray:
    value = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        value *= x
        value += coefficient
    return value
