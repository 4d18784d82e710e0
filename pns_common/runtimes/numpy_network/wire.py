"""Protocol buffers as bytes: the messages of a schema, and nothing that the schema leaves out.

Encoding: https://protobuf.dev/programming-guides/encoding/. Stricter than it asks for: an unknown
field, or a second value where there is one, is an error, so that no other reader of the same bytes
sees anything else.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

VARINT, EIGHT_BYTES, LENGTH, FOUR_BYTES = 0, 1, 2, 5


@dataclass(frozen=True)
class Field:
    """One field of a message: its name, and how its value is read.

    Attributes:
        name: the key that it gets.
        kind: "int" (64 bits, signed), "float" (32 bits), "double", "bytes", or a schema.
        repeated: whether it holds a list; numbers may then be packed.
    """

    name: str
    kind: str | Mapping[int, Field]
    repeated: bool = False


Schema = Mapping[int, Field]
Message = dict[str, Any]

_NUMBER = {"int": VARINT, "float": FOUR_BYTES, "double": EIGHT_BYTES}
_LAYOUT = {FOUR_BYTES: "<f", EIGHT_BYTES: "<d"}


def read_message(data: memoryview, schema: Schema) -> Message:
    """Return the fields that are there; a repeated one is a list and always there.

    Raises:
        ValueError: the bytes are no message of that schema.
    """
    message: Message = {field.name: [] for field in schema.values() if field.repeated}
    for number, wire_type, value in _records(data):
        field = schema.get(number)
        if field is None:
            raise ValueError(f"unknown field {number}")
        values = _values(field, wire_type, value)
        if field.repeated:
            message[field.name].extend(values)
        elif field.name in message:
            raise ValueError(f"{field.name} twice")
        else:
            (message[field.name],) = values
    return message


def _records(data: memoryview) -> Iterator[tuple[int, int, int | memoryview]]:
    """Yield a message's records: number, wire type, and the number or the bytes they hold."""
    position = 0
    while position < len(data):
        key, position = _varint(data, position)
        wire_type = key & 7
        if wire_type == VARINT:
            value, position = _varint(data, position)
            yield key >> 3, wire_type, value
            continue
        if wire_type == LENGTH:
            size, position = _varint(data, position)
        else:
            size = {FOUR_BYTES: 4, EIGHT_BYTES: 8}.get(wire_type, -1)
        if size < 0 or position + size > len(data):
            raise ValueError("truncated, or no protocol buffer")
        yield key >> 3, wire_type, data[position : position + size]
        position += size


def _varint(data: memoryview, position: int) -> tuple[int, int]:
    """Read the number that starts at a byte; return it, and where the next record starts."""
    value = 0
    for shift in range(0, 70, 7):
        if position >= len(data):
            break
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & (2**64 - 1), position
    raise ValueError("truncated, or no protocol buffer")


def _values(field: Field, wire_type: int, value: int | memoryview) -> list[Any]:
    """Return what a record adds to its field."""
    if isinstance(field.kind, str) and field.kind in _NUMBER:
        expected = _NUMBER[field.kind]
        if field.repeated and isinstance(value, memoryview) and wire_type == LENGTH:
            return _packed(expected, value)
        if wire_type == expected:
            return [_number(value)]
    elif isinstance(value, memoryview) and wire_type == LENGTH:
        if isinstance(field.kind, str):
            return [bytes(value)]
        return [read_message(value, field.kind)]
    raise ValueError(f"{field.name} of another type")


def _packed(wire_type: int, data: memoryview) -> list[int | float]:
    if wire_type == VARINT:
        numbers: list[int | float] = []
        position = 0
        while position < len(data):
            value, position = _varint(data, position)
            numbers.append(_signed(value))
        return numbers
    layout = _LAYOUT[wire_type]
    if len(data) % struct.calcsize(layout):
        raise ValueError("packed numbers of another length")
    return [number for (number,) in struct.iter_unpack(layout, data)]


def _number(value: int | memoryview) -> int | float:
    if isinstance(value, int):
        return _signed(value)
    (number,) = struct.unpack("<f" if len(value) == 4 else "<d", value)
    return number


def _signed(value: int) -> int:
    return value - 2**64 if value >= 2**63 else value
