"""What a node of each operator of the allow-list may say, by the operator set of its file.

Later sets take as an input what earlier ones took as an attribute (axes, limits, sizes). A runtime
refuses the one where its set has the other, and so does this.

Definitions: https://onnx.ai/onnx/operators. Attributes that are not computed here are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

# Earlier operator sets broadcast by other rules.
FIRST_OPERATOR_SET = 7


@dataclass(frozen=True)
class Form:
    """What a node may say.

    Attributes:
        since: the first operator set with this form; the next form of the operator ends it.
        least, most: inputs; None: any number.
        attributes: their names.
    """

    since: int
    least: int
    most: int | None
    attributes: tuple[str, ...] = ()


def _always(inputs: int, *attributes: str, since: int = FIRST_OPERATOR_SET) -> tuple[Form]:
    return (Form(since, inputs, inputs, attributes),)


def _reduction(axes_as_input: int) -> tuple[Form, Form]:
    return (
        Form(7, 1, 1, ("axes", "keepdims")),
        Form(axes_as_input, 1, 2, ("keepdims", "noop_with_empty_axes")),
    )


_ANY = (Form(7, 1, None),)
_PRODUCT = ("alpha", "beta", "transA", "transB")
_CONSTANTS = ("value", "value_float", "value_floats", "value_int", "value_ints")

FORMS: Mapping[str, Sequence[Form]] = MappingProxyType(
    {
        **dict.fromkeys(("Abs", "Cos", "Exp", "Identity", "Log", "Neg", "Reciprocal"), _always(1)),
        **dict.fromkeys(("Relu", "Sigmoid", "Sin", "Softplus", "Sqrt", "Tanh"), _always(1)),
        **dict.fromkeys(("Add", "Div", "Mul", "Sub", "Greater", "Less"), _always(2)),
        **dict.fromkeys(("MatMul", "Pow"), _always(2)),
        **dict.fromkeys(("Max", "Min", "Sum"), _ANY),
        **dict.fromkeys(("ReduceL2", "ReduceMax", "ReduceMean"), _reduction(18)),
        "ReduceSum": _reduction(13),
        "ReduceSumSquare": _reduction(18),
        "Cast": (Form(7, 1, 1, ("to",)), Form(19, 1, 1, ("to", "saturate"))),
        "Clip": (Form(7, 1, 1, ("min", "max")), Form(11, 1, 3)),
        "Concat": (Form(7, 1, None, ("axis",)),),
        "Constant": (Form(7, 0, 0, ("value",)), Form(12, 0, 0, _CONSTANTS)),
        "Elu": _always(1, "alpha"),
        "Erf": _always(1, since=9),
        "Gather": _always(2, "axis"),
        "Gelu": _always(1, "approximate", since=20),
        "Gemm": (Form(7, 3, 3, _PRODUCT), Form(11, 2, 3, _PRODUCT)),
        "LeakyRelu": _always(1, "alpha"),
        "Reshape": (Form(7, 2, 2), Form(14, 2, 2, ("allowzero",))),
        "Selu": _always(1, "alpha", "gamma"),
        "Slice": (Form(7, 1, 1, ("starts", "ends", "axes")), Form(10, 3, 5)),
        "Split": (
            Form(7, 1, 1, ("axis", "split")),
            Form(13, 1, 2, ("axis",)),
            Form(18, 1, 2, ("axis", "num_outputs")),
        ),
        "Squeeze": (Form(7, 1, 1, ("axes",)), Form(13, 1, 2)),
        "Transpose": _always(1, "perm"),
        "Unsqueeze": (Form(7, 1, 1, ("axes",)), Form(13, 2, 2)),
        "Where": _always(3, since=9),
    }
)


def fault_of(operator: str, inputs: int, attributes: Sequence[str], version: int) -> str | None:
    """Return what a node says that it may not in an operator set; None where it may all."""
    forms = [form for form in FORMS[operator] if form.since <= version]
    if not forms:
        return f"{operator} in operator set {version}"
    form = forms[-1]
    unknown = sorted(set(attributes) - set(form.attributes))
    if unknown:
        return f"{operator} with attribute {unknown[0]}, in operator set {version}"
    if inputs < form.least or (form.most is not None and inputs > form.most):
        return f"{operator} with {inputs} inputs, in operator set {version}"
    return None
