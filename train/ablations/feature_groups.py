"""Networks over the signed features less one group, or over the paper's and one group more."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import torch
from jaxtyping import Float
from torch import Tensor

from pns_common.features import (
    FEATURE_SETS,
    HALF_TURN,
    MIRROR,
    TURN_OVER,
    Feature,
    Symmetries,
    symmetries,
)
from train.data.batch import Batch
from train.fitting.trainer import OnStep, optimise, step_loss
from train.models.networks import BoundedNet, SymmetricNet, unit_correction
from train.models.recipe import Recipe
from train.reference import EdgeReading, Frames, PaperRule, Surroundings, signed_18
from train.refining import Method

# Features that belong together, in the order of the columns.
GROUPS: Mapping[str, tuple[Feature, ...]] = MappingProxyType(
    {group.name: group.features for group in FEATURE_SETS["signed-18"].groups}
)
PAPER_GROUPS = tuple(group.name for group in FEATURE_SETS["paper-5"].groups)


@dataclass(frozen=True)
class Choice:
    """Groups of features under trial, and what to call them."""

    title: str
    groups: tuple[str, ...]

    @property
    def features(self) -> tuple[Feature, ...]:
        """The features of the groups."""
        return tuple(each for name in self.groups for each in GROUPS[name])

    @property
    def symmetries(self) -> Symmetries:
        """Their group; it has no turn-over where no feature has a sign."""
        signed = any(feature.turn_over < 0 for feature in self.features)
        return symmetries(self.features, [HALF_TURN, MIRROR, *([TURN_OVER] if signed else [])])

    def columns(
        self, around: Surroundings, edges: EdgeReading, frames: Frames
    ) -> Float[Tensor, "E K"]:
        """Return their columns among those of `signed-18`."""
        kept = [name in self.groups for name, group in GROUPS.items() for _ in group]
        return signed_18(around, edges, frames)[:, torch.tensor(kept)]


def choices() -> tuple[Choice, ...]:
    """List all groups, all less each beyond the paper's, the paper's, and these plus each."""
    beyond = [name for name in GROUPS if name not in PAPER_GROUPS]
    return (
        Choice("signed-18", tuple(GROUPS)),
        *(Choice(f"less {name}", tuple(n for n in GROUPS if n != name)) for name in beyond),
        Choice("paper-5", PAPER_GROUPS),
        *(Choice(f"paper-5 and {name}", (*PAPER_GROUPS, name)) for name in beyond),
    )


def fit_features(recipe: Recipe, choice: Choice, on_step: OnStep) -> BoundedNet:
    """Train a symmetric network over a choice of features by the rest of a recipe."""

    def initial(recipe: Recipe) -> BoundedNet:
        generator = torch.Generator().manual_seed(recipe.seed)
        return SymmetricNet(choice.symmetries, recipe.hidden, recipe.activation, generator)

    def loss(network: BoundedNet, batch: Batch) -> Float[Tensor, ""]:
        return step_loss(recipe, batch, _rule(recipe, choice, network)(batch.points, batch.mesh))

    return optimise(recipe, loss, on_step, initial).network


def features_method(recipe: Recipe, choice: Choice, network: BoundedNet) -> Method:
    """Return the trained network as a method."""
    return Method(choice.title, _rule(recipe, choice, network))


def _rule(recipe: Recipe, choice: Choice, network: BoundedNet) -> PaperRule:
    correction, columns = unit_correction(network), choice.columns
    return PaperRule(correction, recipe.budget, recipe.gate_sharpness, columns, first_face=False)
