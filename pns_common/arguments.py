"""What may be asked of a refinement: each argument of ``refine``, checked before any work."""

from __future__ import annotations

from typing import Literal, SupportsIndex

import numpy as np
from jaxtyping import Int

from pns_common.base.blocks import available_threads
from pns_common.base.memory import memory_here
from pns_common.base.parameters import is_bool, is_number, is_whole
from pns_common.connectivity.creases import Creases
from pns_common.errors import ParameterError
from pns_common.schemes import Scheme

HIGHEST_LEVELS = 16
# One level shows little.
DEFAULT_LEVELS = 2
# No refinement takes less for a face that it makes: 65 were measured, by Loop and with levels of
# Loop after learned ones.
LEAST_BYTES_PER_FACE = 60


def check_scheme(given: object) -> None:
    """Refuse what is no Scheme, as ``check_is_mesh`` what is no Mesh."""
    if not isinstance(given, Scheme):
        raise ParameterError(
            "scheme", type(given), expected="a Scheme, as loop() or pns(load_model())"
        )


def checked_levels(given: SupportsIndex) -> int:
    """Return the depth as Python's own whole number: numpy's small ones cannot count faces.

    Raises:
        ParameterError: it is none, or out of range.
    """
    if not (is_whole(given) and 1 <= (levels := int(given)) <= HIGHEST_LEVELS):
        raise ParameterError("levels", given, expected=f"a whole number, 1 … {HIGHEST_LEVELS}")
    return levels


def levels_that_fit(given: SupportsIndex, faces: int) -> int:
    """Return the same of so many faces; what cannot fit into memory for certain is not begun.

    Raises:
        ParameterError: as above, or so many refined faces would take more than the memory here.
    """
    levels, there = checked_levels(given), memory_here()
    needed = faces * 4**levels * LEAST_BYTES_PER_FACE
    if there is None or needed <= there:
        return levels
    raise ParameterError(
        "levels",
        levels,
        expected=f"fewer: {faces * 4**levels:,} faces take {needed / 2**30:,.1f} GiB or more, of "
        f"the {there / 2**30:,.1f} here",
    )


def check_reference_length(given: float | str) -> None:
    """Refuse what is neither "auto" nor a number above 0."""
    # An array compares with a word element by element.
    automatic = isinstance(given, str) and given == "auto"
    if not (automatic or (is_number(given) and float(given) > 0)):
        raise ParameterError("reference_length", given, expected='"auto" or a number > 0')


def check_limit(given: object) -> None:
    """Refuse what is no bool, numpy's included."""
    if not is_bool(given):
        raise ParameterError("limit", given, expected="True or False")


def check_progress(given: object) -> None:
    """Refuse what can be called by nobody; None is nobody to call."""
    if given is not None and not callable(given):
        raise ParameterError("progress", given, expected="a function of two whole numbers, or None")


def checked_threads(given: int | None) -> int:
    """Return how many threads may work; None: one on each processor.

    Raises:
        ParameterError: it is no whole number from 1 on.
    """
    if given is None:
        return available_threads()
    if not (is_whole(given) and given >= 1):
        raise ParameterError("threads", given, expected="a whole number, at least 1")
    return int(given)


def chosen_creases(
    given: Int[np.ndarray, "N 2"] | Creases | Literal["auto"] | None, scheme: Scheme
) -> Creases:
    """Return which edges are kept sharp; "auto": those that the scheme keeps.

    Raises:
        ParameterError: another word, or no pairs of whole numbers.
    """
    if isinstance(given, str):
        if given != "auto":
            raise ParameterError("creases", given, expected='"auto", None or pairs of vertices')
        return scheme.creases
    return given if isinstance(given, Creases) else Creases(given)
