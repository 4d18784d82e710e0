"""The contract of a model file, whoever checks and runs it: inputs, outputs, operators, size.

Input ``features`` float32 [edges, K], input ``budget`` float32 scalar, output ``correction``
float32 [edges, 3]; standard operators from an allow-list; no external data; the model card under
the metadata key ``pns_card``. Where the card names vertex features, also an input
``vertex_features`` float32 [vertices, L] and an output ``vertex_correction`` float32 [vertices, 3].
One call may hold so much and no more.
"""

from __future__ import annotations

from collections.abc import Sequence

from pns_common.errors import ModelError
from pns_common.features.edge_features import FEATURE_COUNT
from pns_common.features.ring_features import RING_FEATURE_SETS
from pns_common.models.card import CARD_KEY, FORMATS, ModelCard

# Rows that one call of a network sees. Always the same shape, so that a row's bits depend neither
# on how many rows there are nor on how they are divided.
CALL_ROWS = 1024
# Bytes of all tensors that a call makes, as if none were freed before its end.
LARGEST_CALL = 256 * 2**20

# Arithmetic and the shape bookkeeping around it: no control flow, no random numbers.
# fmt: off
ALLOWED_OPERATORS = frozenset({
    "Abs", "Add", "Cast", "Clip", "Concat", "Constant", "Cos", "Div", "Elu", "Erf", "Exp",
    "Gather", "Gelu", "Gemm", "Greater", "Identity", "LeakyRelu", "Less", "Log", "MatMul",
    "Max", "Min", "Mul", "Neg", "Pow", "Reciprocal", "ReduceL2", "ReduceMax", "ReduceMean",
    "ReduceSum", "ReduceSumSquare", "Relu", "Reshape", "Selu", "Sigmoid", "Sin", "Slice",
    "Softplus", "Split", "Sqrt", "Squeeze", "Sub", "Sum", "Tanh", "Transpose", "Unsqueeze",
    "Where",
})
# fmt: on

# (name, element type, shape) with "*" for a free dimension.
Signature = tuple[str, str, list[str | int]]


def feature_inputs(card: ModelCard) -> list[tuple[str, int]]:
    """Return the inputs that are features, and how many columns each has."""
    widths = [("features", FEATURE_COUNT[card.features])]
    if card.vertex_features is not None:
        widths.append(("vertex_features", RING_FEATURE_SETS[card.vertex_features].count))
    return widths


def answer_to(given: str) -> str:
    """Return the output that an input of features is read for."""
    return given.replace("features", "correction")


def read_card(texts: Sequence[str], name: str) -> ModelCard:
    """Read the card among the metadata entries of its key; ``name`` is what errors call the file.

    Raises:
        ModelError: there is not one, or it is wrong.
    """
    if len(texts) != 1:
        raise ModelError(name, expected=f"one metadata entry {CARD_KEY}", found=str(len(texts)))
    try:
        return ModelCard.from_json(texts[0])
    except ValueError as error:
        formats = " or ".join(str(version) for version in FORMATS)
        raise ModelError(
            name, expected=f"a model card of format {formats}", found=str(error)
        ) from error


def check_interface(
    inputs: Sequence[Signature], outputs: Sequence[Signature], card: ModelCard, name: str
) -> None:
    """Check what goes in and out against the card.

    Raises:
        ModelError: a name, a type or a shape is another.
    """
    widths = feature_inputs(card)
    wanted_in: list[Signature] = [(what, "FLOAT", ["*", width]) for what, width in widths]
    wanted_in.append(("budget", "FLOAT", []))
    wanted_out: list[Signature] = [(answer_to(what), "FLOAT", ["*", 3]) for what, _ in widths]
    for what, wanted, declared in [("inputs", wanted_in, inputs), ("outputs", wanted_out, outputs)]:
        if sorted(wanted, key=str) != sorted(declared, key=str):
            raise ModelError(name, expected=f"{what} {wanted}", found=f"{list(declared)}")
