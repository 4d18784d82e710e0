"""The adversary of the Reif gap: weights and star that close it, for a given budget C.

Nothing is promised off the plane; how far the margin falls at equal effort shows what C buys.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pns_common import pns
from train.certificates.adversary import Operator, ascend, initial_operator
from train.certificates.planar_spectrum import LIFTS
from train.connectivity import connect
from train.models.networks import BoundedNet
from train.models.recipe import Recipe
from train.models.torch_model import recipe_model
from train.spectra.spectrum import (
    SPOKE,
    STEP,
    Spectrum,
    closed_star,
    continued_spectrum,
    flat_spectrum,
    perturbed_stars,
    refined_inner,
    translation_quotient,
)
from train.spectra.stars import Star

# How far the adversary may move a vertex of the star, in spokes and each coordinate.
SWAY = 0.1

# Stars between the flat one and the final one along which eigenvalues are followed.
#
# With a quarter of them a crossing is taken for another and the margin changes sign; half give
# the same.
FOLLOWED = 65


@dataclass(frozen=True, eq=False)
class GapAttack:
    """The result of the search.

    Attributes:
        before: the margin of the lifted star with the weights before the search.
        after: that of the final star with the final weights, its tangent eigenvalues followed anew
            from the flat star.
        margins: after each step, followed along the search.
        network: the weights in the end, double precision.
    """

    valence: int
    budget: float
    before: float
    after: float
    margins: tuple[float, ...]
    network: BoundedNet


def gap_attack(recipe: Recipe, valence: int, steps: int) -> GapAttack:
    """Minimise the signed Reif margin of a star lifted by 0.4, over weights and vertices.

    The tangent eigenvalues are followed from the flat star to the lifted one, and from there along
    the search.
    """
    operator = initial_operator(recipe)
    scheme = pns(recipe_model(recipe, operator.network))
    star = closed_star(scheme, valence)(LIFTS[-1])
    sway = torch.zeros(star.mesh.vertices.shape, dtype=torch.float64, requires_grad=True)
    copies = _Copies(star, valence)
    basis = translation_quotient(3 * len(star.inner))
    # Not in the blocks of a symmetric star, which it will not stay.
    spectrum = copies.follow(operator, torch.zeros_like(sway), basis)
    before = spectrum.margin

    def look() -> tuple[Tensor, float]:
        nonlocal spectrum
        matrix = copies.jacobian(operator, SWAY * SPOKE * torch.tanh(sway))
        spectrum = continued_spectrum(basis.T @ matrix.detach().numpy() @ basis, spectrum)
        slope = torch.from_numpy(basis @ margin_gradient(spectrum) @ basis.T)
        return -(slope * matrix).sum(), spectrum.margin

    margins = ascend([sway, *operator.weights], look, steps)
    after = copies.follow(operator, SWAY * SPOKE * torch.tanh(sway.detach()), basis).margin
    return GapAttack(valence, recipe.budget, before, after, margins, operator.network)


class _Copies:
    """A star and its perturbed copies, refined together so that their Jacobian is a tensor."""

    def __init__(self, star: Star, valence: int):
        self.star, self.valence, self.step = star, valence, STEP * SPOKE
        mesh, self.count = perturbed_stars(star, self.step)
        copies = mesh.vertices.reshape(2 * self.count, -1, 3)
        self.points = torch.from_numpy(copies.copy())
        self.level = connect(mesh.faces, len(mesh.vertices))

    def jacobian(self, operator: Operator, sway: Float[Tensor, "V 3"]) -> Float[Tensor, "M M"]:
        """Differentiate one step at the star moved by `sway`, by central differences."""
        refined = operator((self.points + sway).reshape(-1, 3), self.level).points
        moved = refined_inner(self.star, refined, 2 * self.count)
        return (moved[: self.count] - moved[self.count :]).T / (2 * self.step)

    def follow(
        self, operator: Operator, sway: Float[Tensor, "V 3"], basis: Float[np.ndarray, "M L"]
    ) -> Spectrum:
        """Follow the spectrum from the flat star, straight to the lifted one moved by `sway`."""
        lifted = torch.from_numpy(self.star.mesh.vertices.copy())
        flat = lifted * torch.tensor([1.0, 1.0, 0.0], dtype=lifted.dtype)
        spectrum: Spectrum | None = None
        for share in np.linspace(0, 1, FOLLOWED):
            shape = flat + share * (lifted + sway - flat) - lifted
            with torch.no_grad():
                matrix = basis.T @ self.jacobian(operator, shape).numpy() @ basis
            spectrum = (
                flat_spectrum(matrix, self.valence)
                if spectrum is None
                else continued_spectrum(matrix, spectrum)
            )
        assert spectrum is not None  # FOLLOWED > 0
        return spectrum


def operator_jacobian(operator: Operator, star: Star) -> Float[Tensor, "M M"]:
    """Return the derivative of the refined inner coordinates by the inner coordinates.

    The counterpart of `train.spectra.spectrum.jacobian`, which takes differences of any scheme.
    """
    level = connect(star.mesh.faces, len(star.mesh.vertices))
    points, refined = torch.tensor(star.mesh.vertices), torch.from_numpy(star.refined)
    where = (torch.from_numpy(star.inner),)

    def inner_to_inner(inner: Float[Tensor, "N 3"]) -> Float[Tensor, " M"]:
        return operator(points.index_put(where, inner), level).points[refined].reshape(-1)

    derivative = torch.autograd.functional.jacobian(inner_to_inner, points[where])
    return derivative.reshape(3 * len(star.inner), -1)


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
