"""How many parts a model file has, counted in its bytes before anything parses them.

A part of two bytes becomes an object of a hundred and sixty: a file of nothing else would take
gigabytes to be read and refused.
"""

from __future__ import annotations

from pns_common.errors import ModelError

# Nodes, their inputs and attributes, tensors, properties. The largest bundled file has hundreds.
MOST_PARTS = 20_000

_LENGTH_DELIMITED = 2
_FIXED_BYTES = {1: 8, 5: 4}
# Of onnx.proto: which fields of these messages are messages that hold parts of their own.
_MODEL, _GRAPH, _NODE, _ATTRIBUTE = range(4)
_CHILDREN = {
    _MODEL: {7: _GRAPH},
    _GRAPH: {1: _NODE},
    _NODE: {5: _ATTRIBUTE},
    _ATTRIBUTE: {6: _GRAPH, 11: _GRAPH},
}


def check_part_count(data: bytes, name: str) -> None:
    """Check that a file has no more than `MOST_PARTS` parts; ``name`` is what errors call it.

    Bytes that are no protocol buffer are left to the parser, which refuses them.

    Raises:
        ModelError: it has more.
    """
    left = MOST_PARTS
    waiting = [(_MODEL, 0, len(data))]
    while waiting:
        kind, at, end = waiting.pop()
        while at < end:
            key, at = _varint(data, at, end)
            wire = key & 7
            if wire == 0:
                _, at = _varint(data, at, end)
                continue
            if wire in _FIXED_BYTES:
                at += _FIXED_BYTES[wire]
                continue
            if wire != _LENGTH_DELIMITED:
                break
            size, at = _varint(data, at, end)
            left -= 1
            if left < 0:
                raise ModelError(name, expected=f"at most {MOST_PARTS} parts", found="more")
            child = _CHILDREN[kind].get(key >> 3)
            if child is not None:
                waiting.append((child, at, min(at + size, end)))
            at += size


def _varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    """Return the number that begins at a place, and the place behind it; at a break the end."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= end:
            break
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    return 0, end
