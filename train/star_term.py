"""The star term: a margin of the Reif gap on lifted stars, asked for while training.

One step of the operator around a lifted star is differentiated as `train.spectrum` does, but by
torch, and its eigenvalues' slopes follow from the left and right eigenvectors: dλ = l dA r.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pns_common.edge_operator import EdgeOperator
from pns_common.mesh import Mesh
from pns_common.schemes import loop
from pns_common.topology import Topology, build_topology
from pns_common.vertex_operator import VertexOperator
from train.margin_gradient import separation
from train.one_step import refine_once
from train.spectrum import (
    SPOKE,
    Spectrum,
    continued_spectrum,
    flat_spectrum,
    jacobian,
    perturbed_stars,
    quotient_blocks,
    refined_inner,
    strides,
    translation_quotient,
    without_translations,
)
from train.stars import Star, star

RINGS, INNER_RINGS = 4, 3
"""As far as one step with signed features and a vertex rule sees."""

MANY = 7
"""From this valence on the stars have a ring less: a fifth of the work for nearly the same."""

STEP = 1e-3
"""Of the central differences, in spokes: a network in single precision needs it so large."""

HIGHEST_LIFT, GROWTH = 0.45, 1.5
"""Lifts are looked at from small ones on, each so many times the one before."""


@dataclass(frozen=True, eq=False)
class StarCopies:
    """A flat star, and its copies with each inner coordinate moved up and down.

    Attributes:
        count: inner coordinates M.
        topology: of the 2 M copies.
        quotient: basis of what is orthogonal to translations.
        flat: Loop's spectrum, in the blocks that symmetric rules keep.
    """

    star: Star
    count: int
    topology: Topology
    quotient: Float[np.ndarray, "M L"]
    flat: Spectrum


def star_copies(valence: int) -> StarCopies:
    """Return the copies of the star of one valence."""
    less = 1 if valence >= MANY else 0
    at = star(valence, RINGS - less, SPOKE, inner_rings=INNER_RINGS - less)
    mesh, count = perturbed_stars(at, STEP * SPOKE)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    matrix = without_translations(jacobian(loop(), at))
    flat = flat_spectrum(matrix, valence, quotient_blocks(at, valence))
    return StarCopies(at, count, topology, translation_quotient(count), flat)


class StarTerm:
    """Draws a valence and a lift at each call, from a generator of its own."""

    def __init__(
        self,
        seed: int,
        wanted: float,
        shares: Sequence[tuple[int, float]],
        device: torch.device | str = "cpu",
    ):
        self._rng = np.random.default_rng(seed)
        self._wanted = wanted
        self._device = device
        self._valences, self._shares = map(list, zip(*shares, strict=True))
        self._stars = {valence: star_copies(valence) for valence in self._valences}

    def __call__(
        self, operator: EdgeOperator, budget: float, vertex_operator: VertexOperator | None
    ) -> Float[Tensor, ""]:
        """Return by how much the margin falls short of what is wanted, where it is least.

        A star of random valence is lifted to a random height, and looked at all the way.
        """
        valence = int(self._rng.choice(self._valences, p=self._shares))
        copies = self._stars[valence]
        basis = copies.quotient

        def jacobian_at(lift: float) -> Float[Tensor, "M M"]:
            points = perturbed_points(copies, lift).to(self._device)
            return star_jacobian(copies, points, operator, budget, vertex_operator)

        def matrix_at(lift: float) -> Float[np.ndarray, "L L"]:
            with torch.no_grad():
                return basis.T @ jacobian_at(lift).cpu().numpy() @ basis

        spectrum, least = copies.flat, (math.inf, 0.0, np.zeros(0))
        for lift in strides(0.0, HIGHEST_LIFT * self._rng.uniform(1 / GROWTH, 1), GROWTH):
            spectrum = continued_spectrum(matrix_at(lift), spectrum)
            apart, slope = separation(spectrum)
            if apart < least[0]:
                least = (apart, lift, slope)
        apart, lift, slope = least
        if apart >= self._wanted:
            return torch.zeros(())
        matrix = jacobian_at(lift)
        # The value, with the slope that eigenvectors give it.
        moving = (torch.from_numpy(basis @ slope @ basis.T).to(matrix) * matrix).sum()
        return self._wanted - apart - (moving - moving.detach())


def perturbed_points(copies: StarCopies, lift: float) -> Float[Tensor, "P 3"]:
    """Return the vertices of all copies of the star, its centre lifted by so many spokes."""
    points = copies.star.mesh.vertices.copy()
    points[0, 2] = lift * SPOKE
    lifted = replace(copies.star, mesh=Mesh(points, copies.star.mesh.faces))
    mesh, _ = perturbed_stars(lifted, STEP * SPOKE)
    return torch.from_numpy(mesh.vertices.copy())


def star_jacobian(
    copies: StarCopies,
    points: Float[Tensor, "P 3"],
    operator: EdgeOperator,
    budget: float,
    vertex_operator: VertexOperator | None,
) -> Float[Tensor, "M M"]:
    """Differentiate one step at perturbed copies, inner rings to inner rings."""
    count = copies.count
    refined = refine_once(points, copies.topology, operator, budget, vertex_operator).points
    moved = refined_inner(copies.star, refined, 2 * count)
    return (moved[:count] - moved[count:]).T / (2 * STEP * SPOKE)
