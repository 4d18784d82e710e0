"""A model file checked and run in numpy: the same contract and limits as with onnxruntime.

Floats are held in double precision and the answer is rounded to single once, so it is nearer to the
exact one than a run in single precision, which differs from it by that run's own rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pns_common.errors import ModelError
from pns_common.models.card import CARD_KEY, ModelCard
from pns_common.models.contract import (
    ALLOWED_OPERATORS,
    CALL_ROWS,
    LARGEST_CALL,
    Signature,
    answer_to,
    check_interface,
    feature_inputs,
    read_card,
)
from pns_common.runtimes.numpy_network.onnx_schema import (
    FLOAT,
    Node,
    node,
    read_model,
    tensor,
    text,
)
from pns_common.runtimes.numpy_network.operator import Operator, outline_of
from pns_common.runtimes.numpy_network.operator_sets import FIRST_OPERATOR_SET, fault_of
from pns_common.runtimes.numpy_network.operators import OPERATORS
from pns_common.runtimes.numpy_network.wire import Message

# A call is measured as a runtime in single precision would hold it: bytes by kind of number.
BYTES_HELD = {"f": 4, "i": 8, "b": 1}
# What numpy raises for a node that cannot be computed; a file chooses the nodes.
FAULTS = (ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError)


class _RefusedError(Exception):
    """What the contract expects and a file has instead."""

    def __init__(self, expected: str, found: str):
        self.expected, self.found = expected, found
        super().__init__(f"expected {expected}, found {found}")


@dataclass(frozen=True, eq=False)
class NumpyNetwork:
    """A checked graph, ready to run."""

    nodes: Sequence[Node]
    weights: Mapping[str, np.ndarray]

    def __repr__(self) -> str:
        return f"NumpyNetwork(nodes={len(self.nodes)}, weights={len(self.weights)})"

    def run(self, output: str, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return one output in single precision; ``inputs`` are arrays by name.

        Raises:
            ValueError: a node cannot be computed with these values.
        """
        values = dict(self.weights)
        values |= {name: np.asarray(array, dtype=np.float64) for name, array in inputs.items()}
        try:
            with np.errstate(all="ignore"):  # what is not finite is refused by the caller
                for step in self.leading_to(output):
                    given = [values[name] if name else None for name in step.inputs]
                    made = OPERATORS[step.operator].compute(given, step.attributes)
                    values.update(zip(step.outputs, made, strict=True))
                return values[output].astype(np.float32)
        except FAULTS as error:
            raise ValueError(str(error)) from error

    def leading_to(self, output: str) -> list[Node]:
        """Return the nodes that an output depends on, in order."""
        wanted = {output}
        steps: list[Node] = []
        for step in reversed(self.nodes):
            if wanted & set(step.outputs):
                wanted |= set(step.inputs)
                steps.append(step)
        return steps[::-1]


def open_network(data: bytes, name: str) -> tuple[ModelCard, NumpyNetwork]:
    """Check the bytes of a model file; ``name`` is what errors call it.

    Raises:
        ModelError: the file breaks the contract; says which part.
    """
    try:
        message = read_model(data)
    except ValueError as error:
        raise ModelError(name, expected="an ONNX file", found=f"other bytes ({error})") from error
    try:
        _check_messages(message)
        network = _network(message)
        card = read_card(
            [text(e, "value") for e in message["metadata_props"] if text(e, "key") == CARD_KEY],
            name,
        )
        inputs, outputs = _signatures(message["graph"], network.weights)
        check_interface(inputs, outputs, card, name)
        _check_names(network, [signature[0] for signature in inputs])
        _check_calls(network, card)
    except _RefusedError as error:
        raise ModelError(name, expected=error.expected, found=error.found) from error
    except FAULTS as error:
        raise ModelError(name, expected="a valid ONNX model", found=str(error)) from error
    return card, network


def _check_messages(message: Message) -> None:
    """Refuse what a model file may not hold, by name."""
    if "graph" not in message:
        raise ValueError("no graph")
    graph = message["graph"]
    if message["functions"] or message["training_info"]:
        raise _RefusedError("one graph", "functions or training graphs beside it")
    if graph["sparse_initializer"]:
        raise _RefusedError("dense weights", "a sparse initializer")
    tensors = list(graph["initializer"])
    for each in graph["node"]:
        operator, domain = text(each, "op_type"), text(each, "domain")
        if domain not in ("", "ai.onnx") or operator not in ALLOWED_OPERATORS:
            qualified = f"{domain}.{operator}" if domain else operator
            raise _RefusedError("operators from the allow-list", qualified)
        for attribute in each["attribute"]:
            if "g" in attribute or attribute["graphs"]:
                raise _RefusedError("one graph", f"a graph in {operator}")
            if "sparse_tensor" in attribute or attribute["sparse_tensors"]:
                raise _RefusedError("dense weights", "a sparse tensor")
            tensors += [attribute["t"]] if "t" in attribute else []
    if any(each.get("data_location", 0) or each["external_data"] for each in tensors):
        raise _RefusedError("all weights inside the file", "external data")
    versions = _operator_sets(message)
    if not versions or min(versions) < FIRST_OPERATOR_SET:
        raise _RefusedError(f"operator set {FIRST_OPERATOR_SET} or later", f"{versions}")


def _network(message: Message) -> NumpyNetwork:
    graph = message["graph"]
    weights = {text(each, "name"): tensor(each) for each in graph["initializer"]}
    if len(weights) < len(graph["initializer"]):
        raise ValueError("two weights of one name")
    nodes, version = [node(each) for each in graph["node"]], min(_operator_sets(message))
    for step in nodes:
        fault = fault_of(step.operator, len(step.inputs), list(step.attributes), version)
        if fault is not None:
            raise ValueError(fault)
    return NumpyNetwork(nodes, weights)


def _operator_sets(message: Message) -> list[int]:
    sets = message["opset_import"]
    return [each.get("version", 0) for each in sets if text(each, "domain") in ("", "ai.onnx")]


def _signatures(
    graph: Message, weights: Mapping[str, np.ndarray]
) -> tuple[list[Signature], list[Signature]]:
    """Return the inputs (old files list weights there too) and the outputs."""
    inputs = [_signature(value) for value in graph["input"]]
    outputs = [_signature(value) for value in graph["output"]]
    return [each for each in inputs if each[0] not in weights], outputs


def _signature(value: Message) -> Signature:
    held = value.get("type", {}).get("tensor", {})
    dims = held.get("shape", {}).get("dims", [])
    element = "FLOAT" if held.get("element") == FLOAT else f"type {held.get('element')}"
    return text(value, "name"), element, [dim.get("value", "*") for dim in dims]


def _check_names(network: NumpyNetwork, inputs: Sequence[str]) -> None:
    """Check that each tensor is made once, before it is read, and that sizes are constants."""
    known, constant = {*inputs, *network.weights}, set(network.weights)
    for step in network.nodes:
        operator = OPERATORS[step.operator]
        missing = [each for each in step.inputs if each and each not in known]
        made = [each for each in step.outputs if each]
        if missing or set(made) & known or len(set(made)) < len(made):
            raise ValueError(f"{step.operator} of {missing or made}, out of order")
        if not _shaped_by(step, operator) <= constant:
            raise _RefusedError(
                "shapes that follow from the file", made[0] if made else step.operator
            )
        known |= set(made)
        constant |= set(made) if step.operator == "Constant" else set()


def _shaped_by(step: Node, operator: Operator) -> set[str]:
    """Return the inputs of a node that its shape follows from by their values."""
    return {step.inputs[i] for i in operator.shaping if i < len(step.inputs)} - {""}


def _check_calls(network: NumpyNetwork, card: ModelCard) -> None:
    """Measure each call, and look at the shape that it answers with, before any is made."""
    widths = dict(feature_inputs(card))
    for given in widths:
        rows = {what: CALL_ROWS if what == given else 1 for what in widths}
        inputs = {what: outline_of((rows[what], width), float) for what, width in widths.items()}
        output = answer_to(given)
        shape = _outlines(network, inputs | {"budget": outline_of((), float)})[output].shape
        if list(shape) != [CALL_ROWS, 3]:
            raise _RefusedError(f"{output} of shape {[CALL_ROWS, 3]}", str(list(shape)))


def _outlines(network: NumpyNetwork, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the outlines of all tensors of a call; constants as they are."""
    outlines, held = {**network.weights, **inputs}, 0
    for step in network.nodes:
        try:
            given = [outlines[name] if name else None for name in step.inputs]
            made = OPERATORS[step.operator].outline(given, step.attributes)
        except FAULTS as error:
            raise _RefusedError("shapes that fit together", f"{step.operator}: {error}") from error
        if len(made) != len(step.outputs):
            outputs = f"{step.operator} with {len(step.outputs)} outputs, not {len(made)}"
            raise _RefusedError("shapes that fit together", outputs)
        held += sum(each.size * BYTES_HELD[each.dtype.kind] for each in made)
        if held > LARGEST_CALL:
            raise _RefusedError(f"at most {LARGEST_CALL} bytes in one call", str(held))
        outlines.update(zip(step.outputs, made, strict=True))
    return outlines
