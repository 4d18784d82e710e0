"""Numbers as mesh files write them: Python, and numpy with it, takes 1_0 for ten as well."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from jaxtyping import Float


def whole(word: bytes) -> int:
    """Return a whole number. Raises ValueError."""
    if b"_" in word:
        raise ValueError("an underscore is no digit")
    return int(word)


def reals(rows: Sequence[Sequence[bytes | None]]) -> Float[np.ndarray, "N K"]:
    """Return rows of as many numbers each; NaN where one is None. Raises ValueError."""
    if b"_" in b"".join(filter(None, chain.from_iterable(rows))):
        raise ValueError("an underscore is no digit")
    return np.array(rows, dtype=np.float64)
