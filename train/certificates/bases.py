"""The base schemes as certificates know them: written plainly, and what is published of them."""

from collections.abc import Callable
from dataclasses import dataclass

from pns_common import Scheme, catmull_clark, loop
from train.certificates.plain import PlainStep, plain_catmull_clark, plain_loop
from train.spectra.spectrum import (
    catmull_clark_eigenvalue,
    catmull_clark_gap,
    loop_eigenvalue,
    loop_gap,
)
from train.spectra.stars import BuildStar, quad_star, star


@dataclass(frozen=True)
class Base:
    """A base scheme.

    Attributes:
        scheme: the library's.
        plain: takes one step of it, by nothing of the library.
        star: builds its stars.
        eigenvalue, gap: return the tangent eigenvalue of a valence, and its Reif gap.
        formula: that eigenvalue, in words.
    """

    name: str
    scheme: Scheme
    plain: Callable[..., PlainStep]
    star: BuildStar
    eigenvalue: Callable[[int], float]
    gap: Callable[[int], float]
    formula: str


LOOP = Base("Loop", loop(), plain_loop, star, loop_eigenvalue, loop_gap, "3/8 + ¼ cos 2π/k")
CATMULL_CLARK = Base(
    "Catmull–Clark",
    catmull_clark(),
    plain_catmull_clark,
    quad_star,
    catmull_clark_eigenvalue,
    catmull_clark_gap,
    "the published ones",
)
