"""Adversaries: gradient ascent over weights and mesh at once, against what the theorems promise.

A theorem that holds for any weights must hold for the worst that a search finds. Everything runs in
double precision on the operator's own kernels; each value is recomputed from positions at every
step of the search, not only at its end.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pns_common import Mesh
from train.certificates.affine import TURNED
from train.certificates.bodies import bumpy_sphere, random_motion
from train.certificates.displacement import AT_MOST, worst_ratio
from train.certificates.equivariance import EXACT, well_conditioned
from train.certificates.plain import plain_loop
from train.connectivity import Connectivity, connect
from train.data.datasets import grid_faces, jittered_grid
from train.fitting.determinism import deterministic
from train.models.from_recipe import initial_network, paper_rule
from train.models.networks import BoundedNet
from train.models.recipe import Recipe
from train.reference import Step

# Adam's step: weights and vertices are both of size one.
RATE = 0.02


@dataclass(frozen=True, eq=False)
class Attack:
    """The result of a search.

    Attributes:
        cap: what the theorem lets the value reach.
        values: after each step.
        network: the edge weights in the end, double precision.
        mesh: the mesh in the end.
    """

    name: str
    cap: float
    values: tuple[float, ...]
    network: BoundedNet
    mesh: Mesh

    @property
    def worst(self) -> float:
        """The largest value of the whole search; a NaN is worse than any."""
        return float(np.max(self.values))

    @property
    def held(self) -> bool:
        """True where the value stayed at or below its cap throughout."""
        return self.worst <= self.cap


@dataclass(frozen=True, eq=False)
class Operator:
    """The learned operator of a recipe with weights that may change, on torch tensors."""

    network: BoundedNet
    recipe: Recipe

    def __call__(self, points: Float[Tensor, "V 3"], mesh: Connectivity) -> Step:
        """Refine by one step at reference length 1."""
        return paper_rule(self.recipe, self.network)(points, mesh)

    @property
    def weights(self) -> list[Tensor]:
        """All that an adversary may change about it."""
        return list(self.network.parameters())


def initial_operator(recipe: Recipe) -> Operator:
    """Return the recipe's operator before training, in double precision."""
    return Operator(initial_network(recipe).double(), recipe)


def ascend(
    variables: Sequence[Tensor],
    look: Callable[[], tuple[Float[Tensor, ""], float]],
    steps: int,
) -> tuple[float, ...]:
    """Climb by Adam; `look` returns the objective and the value that is recorded."""
    values: list[float] = []
    with deterministic():
        optimiser = torch.optim.Adam(variables, lr=RATE, maximize=True)
        for _ in range(steps):
            optimiser.zero_grad()
            objective, value = look()
            objective.backward()
            optimiser.step()
            values.append(value)
    return tuple(values)


def proximity_attack(recipe: Recipe, steps: int) -> Attack:
    """Maximise the proximity ratio ‖q − q0‖ / (C h²); it must find 1 and never pass it."""
    operator, mesh = initial_operator(recipe), bumpy_sphere(recipe.seed)
    level = connect(mesh.faces, len(mesh.vertices))
    points = torch.tensor(mesh.vertices, requires_grad=True)

    def look() -> tuple[Tensor, float]:
        step = operator(points, level)
        # A soft maximum: every edge gets a gradient, the leading ones the most.
        objective = torch.logsumexp(20 * step.ratio[len(points) + level.interior], dim=0)
        control, refined = _mesh(points, mesh), step.points.detach().numpy()
        base = plain_loop(control.vertices, control.faces)
        ratio, _ = worst_ratio(control, refined, recipe.budget, base)
        return objective, ratio

    values = ascend([points, *operator.weights], look, steps)
    return Attack("proximity ratio", AT_MOST, values, operator.network, _mesh(points, mesh))


def equivariance_attack(recipe: Recipe, steps: int) -> Attack:
    """Maximise ‖S(gM) − g S(M)‖ over weights, mesh and, at random, the rigid motion g.

    Ill-conditioned frames are left out, as in the certificate.
    """
    operator, mesh = initial_operator(recipe), bumpy_sphere(recipe.seed)
    level = connect(mesh.faces, len(mesh.vertices))
    points = torch.tensor(mesh.vertices, requires_grad=True)
    rng = np.random.default_rng(recipe.seed)

    def look() -> tuple[Tensor, float]:
        turn, shift = (torch.from_numpy(part) for part in random_motion(rng))
        moved = operator(points @ turn.T + shift, level).points
        apart = moved - (operator(points, level).points @ turn.T + shift)
        good = np.ones(len(apart), dtype=bool)
        good[len(points) :] = well_conditioned(_mesh(points, mesh))
        kept = apart[torch.from_numpy(good)]
        value = float(torch.linalg.vector_norm(kept.detach(), dim=1).max())
        # Scaled up, or its square would be lost below Adam's own ε.
        return ((kept / EXACT) ** 2).sum(), value

    values = ascend([points, *operator.weights], look, steps)
    return Attack("equivariance", EXACT, values, operator.network, _mesh(points, mesh))


def affine_attack(recipe: Recipe, turn: Float[np.ndarray, "3 3"], cap: float, steps: int) -> Attack:
    """Maximise ‖δ‖ / h² on planar meshes, over weights and vertices that slide in the plane.

    Args:
        turn: of the plane z = 0; with the identity the cap is 0.
        cap: 0 on an axis-aligned plane, else `TURNED`.
    """
    operator, plane = initial_operator(recipe), jittered_grid(recipe.seed, jitter=0.0).double()
    level = connect(grid_faces(), len(plane))
    normal = torch.from_numpy(turn.copy())
    slide = torch.zeros_like(plane, requires_grad=True)

    def lay() -> Tensor:
        # At most 0.06 of a spacing of 0.25, so that no face folds over.
        return torch.nn.functional.pad(plane + 0.06 * torch.tanh(slide), (0, 1)) @ normal.T

    def look() -> tuple[Tensor, float]:
        points = lay()
        # ‖δ‖ / (C h²), where h² is not zero: the ratio resolves what positions would round away.
        ratio = operator(points, level).ratio
        return (ratio / TURNED).sum(), recipe.budget * float(ratio.detach().max())

    values = ascend([slide, *operator.weights], look, steps)
    plane_mesh = Mesh(lay().detach().numpy(), grid_faces())
    return Attack("affine reproduction", cap, values, operator.network, plane_mesh)


def _mesh(points: Float[Tensor, "V 3"], like: Mesh) -> Mesh:
    return Mesh(points.detach().numpy(), like.faces)
