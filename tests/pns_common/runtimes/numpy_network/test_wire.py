"""Protocol buffers read by hand, against the library that onnx brings with it."""

import contextlib

import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import ModelError
from pns_common.runtimes.numpy_network import onnx_schema, open_network
from pns_common.runtimes.numpy_network.wire import Field, read_message
from tests.support.networks import perceptron_bytes, random_layers

GOOD = perceptron_bytes(random_layers(0))
NUMBERS = {1: Field("one", "int"), 2: Field("many", "int", repeated=True), 3: Field("x", "double")}
# What is one message here, and a tag of a choice ("value" of TypeProto) in the definition.
NAMES = {"tensor": "tensor_type", "element": "elem_type", "dims": "dim"}


def check_against(schema, descriptor):
    """Each field of a schema has the number, name and kind of the published definition."""
    for number, field in schema.items():
        published = descriptor.fields_by_number[number]
        names = {field.name, NAMES.get(field.name), f"dim_{field.name}"}
        names |= {"dim_param"} if field.name == "name" else set()
        assert published.name in names
        assert published.is_repeated == field.repeated
        if not isinstance(field.kind, str):
            check_against(field.kind, published.message_type)


def test_field_numbers_are_the_published_ones():
    check_against(onnx_schema.MODEL, onnx.ModelProto.DESCRIPTOR)


def message(data):
    return read_message(memoryview(data), NUMBERS)


@pytest.mark.parametrize("value", [0, 1, 300, 2**62, -1, -(2**63)])
def test_numbers_of_any_length_and_sign(value):
    proto = onnx.AttributeProto(i=value)
    schema = {3: Field("i", "int")}
    assert read_message(memoryview(proto.SerializeToString()), schema) == {"i": value}


def test_numbers_may_be_packed_or_not():
    assert message(b"\x12\x03\x01\xac\x02")["many"] == [1, 300]
    assert message(b"\x10\x01\x10\xac\x02")["many"] == [1, 300]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"\x08", "truncated"),
        (b"\x08" + b"\xff" * 11, "truncated"),
        (b"\x0b", "truncated"),  # a group, which no schema here has
        (b"\x12\x05\x01", "truncated"),
        (b"\x08\x01\x08\x02", "one twice"),
        (b"\x20\x01", "unknown field 4"),
        (b"\x0a\x00", "one of another type"),
        (b"\x1a\x00", "x of another type"),
    ],
)
def test_other_bytes_are_refused(data, says):
    with pytest.raises(ValueError, match=says):
        message(data)


def test_packed_numbers_of_another_length_are_refused():
    with pytest.raises(ValueError, match="another length"):
        read_message(memoryview(b"\x0a\x03abc"), {1: Field("x", "float", repeated=True)})


@given(st.integers(0, len(GOOD) - 1), st.integers(1, 255))
def test_a_changed_byte_is_a_model_or_a_model_error(at, change):
    data = bytearray(GOOD)
    data[at] ^= change
    with contextlib.suppress(ModelError):
        open_network(bytes(data), "changed")


@given(st.binary(max_size=200))
def test_any_bytes_are_refused_as_a_model(data):
    with pytest.raises(ModelError):
        open_network(data, "any")
