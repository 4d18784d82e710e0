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
class LimitWeights:
    """Weights of the limit loss (train/fitting/limit_loss.py); each term is an error over Loop's.

    Attributes:
        mean, spread, peak: distance: its mean, its root mean square, its soft maximum.
        normal: mean difference of normals.
        worse: beside each of these, what is above `worse_from` of Loop's.
        sharp: cross entropy of sharpness and truth.
    """

    mean: float
    spread: float
    peak: float
    normal: float
    worse: float
    worse_from: float
    sharp: float


@dataclass(frozen=True, slots=True)
class VertexRule:
    """The learned rule for old vertices: its features, hidden widths and gate, as on the card."""

    features: str
    hidden: tuple[int, ...]
    gate_sharpness: float


@dataclass(frozen=True, slots=True)
class NetworkShape:
    """The sharpness or the face network.

    Attributes:
        features: name of its features.
        hidden: hidden widths.
        of_model: a bundled model whose sharpness network is taken over and not trained.
    """

    features: str
    hidden: tuple[int, ...]
    of_model: str | None = None


@dataclass(frozen=True, slots=True)
class ScaleFree:
    """The numbers that make a recipe's rule scale-free (format 4), as on the card.

    Attributes:
        base: the base scheme, "loop" or "catmull-clark".
        prior_strength: s.
        boundary_strength: of the prior along boundary and crease curves.
        network_scale: τ, in edge lengths.
        fold_angle: θ, degrees.
        sharpness_levels: at how many levels sharp edges stay sharp; training takes two.
    """

    base: str
    prior_strength: float
    boundary_strength: float
    network_scale: float
    fold_angle: float
    sharpness_levels: int


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
    """Weights of errors over the base scheme's on a pair (train/fitting/training_pair.py).

    Attributes:
        mean, spread, peak: of distances: mean, root mean square, 8-norm.
        normal: mean chord between normals.
        worse: beside each of these, what is above `worse_from`.
    """

    mean: float
    spread: float
    peak: float
    normal: float
    worse: float
    worse_from: float


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


class ToLimit(msgspec.Struct, frozen=True, tag=True):
    """Training on the limit surface after one learned level, over the stream of pairs.

    The learning rate rises to the recipe's in the first tenth of the steps and falls to nothing.

    Attributes:
        weights: of the loss.
        faces: coarse faces in a batch, about.
        pool: batches kept to draw from, at most.
        reuse: after every so many steps a new batch comes in, in the end for the oldest.
        start: steps at the beginning in which sharpness alone is trained, against the truth.
    """

    weights: LimitWeights
    faces: int
    pool: int
    reuse: int
    start: int


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
        vertex: the learned rule for old vertices; None leaves them to Loop.
        scale_free: the rule of format 4; None is the paper's.
        sharpness: its sharpness network.
        face: its network of face vertices, over Catmull–Clark.
        directed: the rule of directed edges (format 5), in place of the four before.
    """

    name: str
    features: str
    hidden: tuple[int, ...]
    activation: str
    budget: float
    gate_sharpness: float
    training: OneStep | ToLimit | OnPairs
    steps: int
    learning_rate: float
    seed: int
    orientation: str = "first-face"
    vertex: VertexRule | None = None
    scale_free: ScaleFree | None = None
    sharpness: NetworkShape | None = None
    face: NetworkShape | None = None
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
    """Return a recipe of so many steps, 1 or more; what happens at a share of them still does."""
    plan = recipe.training
    if isinstance(plan, ToLimit):
        start = plan.start * steps // recipe.steps
        plan = msgspec.structs.replace(plan, start=start)
    return replace(recipe, steps=steps, training=plan)


def scale_free_parts(recipe: Recipe) -> tuple[ScaleFree, VertexRule]:
    """Return a scale-free recipe's form and vertex rule.

    Raises:
        ParameterError: it is not scale-free, or has no vertex rule.
    """
    form, rule = recipe.scale_free, recipe.vertex
    if form is None or rule is None:
        raise ParameterError("recipe", recipe.name, expected="a scale-free one with a vertex rule")
    return form, rule
