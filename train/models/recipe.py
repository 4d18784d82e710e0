"""The recipe: everything that decides a network's trained weights."""

from dataclasses import dataclass, replace

import msgspec

from pns_common import ParameterError


@dataclass(frozen=True, slots=True)
class LossWeights:
    """Weights of the four loss terms (λ_sdf, λ_n, λ_f, λ_p in the paper)."""

    distance: float
    normal: float
    fairness: float
    proximity: float


@dataclass(frozen=True, slots=True)
class DirectedForm:
    """The rule of directed edges and its network (format 5), as on the card.

    Attributes:
        base: the base scheme, "loop" or "catmull-clark".
        width, hidden, rounds: of states, of hidden layers, and of messages.
        budget: C.
        gate_sharpness, vertex_gate_sharpness: c, c_v.
        network_scale: τ, in edge lengths.
        curve_strength: of the prior along boundaries.
        fold_angle: θ, degrees.
        sharpness_levels: at how many levels sharp edges stay sharp; training takes two.
    """

    base: str
    width: int
    hidden: int
    rounds: int
    budget: float
    gate_sharpness: float
    vertex_gate_sharpness: float
    network_scale: float
    curve_strength: float
    fold_angle: float
    sharpness_levels: int


class OneStep(msgspec.Struct, frozen=True, tag=True):
    """Training on one step, at the inserted vertices, over a fixed data set.

    Attributes:
        dataset: its name.
        weights: of the loss.
        batch_size: meshes in each step, drawn without replacement (at most the whole set).
        final_learning_rate: at the last step, to which the rate falls along a half cosine; the same
            value as the first gives a constant rate.
        quiet: weight of the quiet term (train/fitting/quiet.py), for the features paper-5; 0 leaves
            it out.
    """

    dataset: str
    weights: LossWeights
    batch_size: int
    final_learning_rate: float
    quiet: float = 0.0


@dataclass(frozen=True, slots=True)
class PairWeights:
    """Weights of what a pair's limit surface is judged by.

    Errors are over the base scheme's (train/fitting/training_pair.py).

    Attributes:
        mean, spread, peak: of distances: mean, root mean square, 8-norm.
        normal: mean chord between normals.
        sharp: mean sharpness of edges between two faces: what gains nothing stays smooth.
    """

    mean: float
    spread: float
    peak: float
    normal: float
    sharp: float


class OnPairs(msgspec.Struct, frozen=True, tag=True):
    """Training on stored pairs of real shapes and of the procedural stream.

    Attributes:
        weights: of the loss.
        meshes: in each step.
        real: how often a pair is of a real shape.
        kinds: how often these are of each kind, up to a factor.
        procedural: pairs of the stream.
        most_faces: larger coarse meshes are left out.
    """

    weights: PairWeights
    meshes: int
    real: float
    kinds: dict[str, float]
    procedural: int
    most_faces: int


@dataclass(frozen=True, slots=True)
class Recipe:
    """Everything that decides the trained weights, apart from the machine.

    Attributes:
        features: name of the feature set, as on the model card.
        hidden: widths of the hidden layers.
        activation: "gelu", "silu" or "tanh", between layers.
        budget: C, in the paper's units (the reference length is 1).
        gate_sharpness: c of the gate tanh(c x²).
        training: what is trained on, and how.
        steps: Adam steps.
        learning_rate: the highest.
        seed: of the initial weights and of the batches.
        orientation: as on the model card; "symmetric" keeps the stencil's symmetries.
        directed: the rule of directed edges (format 5); None is the paper's.
    """

    name: str
    features: str
    hidden: tuple[int, ...]
    activation: str
    budget: float
    gate_sharpness: float
    training: OneStep | OnPairs
    steps: int
    learning_rate: float
    seed: int
    orientation: str = "first-face"
    directed: DirectedForm | None = None


def one_step(recipe: Recipe) -> OneStep:
    """Return how a recipe trains on one step.

    Raises:
        ParameterError: it trains otherwise.
    """
    if not isinstance(recipe.training, OneStep):
        raise ParameterError("recipe", recipe.name, expected="one that trains on one step")
    return recipe.training


def of_length(recipe: Recipe, steps: int) -> Recipe:
    """Return a recipe of so many steps, 1 or more."""
    return replace(recipe, steps=steps)
