"""JSON text in and out: strict, and bounded before anything is decoded.

A decoder's cost is in the values it makes, not in the bytes it reads: 64 MiB of `{},` make tens of
millions of objects. So the characters that open or separate values are counted in the raw bytes
first (those inside strings too: the count may only err upwards), and so is the depth.
"""

from __future__ import annotations

import re
from typing import Any

import msgspec
import numpy as np

from service.errors import GltfError, UnreadableError, check_limit
from service.options import Limits

# Possessive, and an unterminated string runs to the end: no quote is ever looked at twice, however
# hostile the text.
_QUOTE = 2
_MARKS = np.zeros(256, dtype=np.int8)
_MARKS[[ord(mark) for mark in '{["]}']] = [1, 1, _QUOTE, -1, -1]
_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+(?:"|\\?\Z)', re.DOTALL)


def decode_object(text: bytes, limits: Limits) -> dict[str, Any]:
    """The JSON object that `text` holds.

    Raises:
        LimitError: too many values or too deep.
        UnreadableError: not JSON (RFC 8259; so no NaN or Infinity), or not UTF-8.
        GltfError: JSON, but not an object.
    """
    _check_size(text, limits)
    try:
        value = msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise UnreadableError(f"the JSON cannot be decoded: {error}") from error
    if not isinstance(value, dict):
        raise GltfError("the JSON's top level must be an object", pointer="")
    return value


def encode(value: Any) -> bytes:
    """Compact UTF-8 JSON, keys in the order that they have."""
    return msgspec.json.encode(value)


def _check_size(text: bytes, limits: Limits) -> None:
    items = sum(text.count(mark) for mark in b'{[,:"')
    check_limit("json-items", items, limits.max_json_items, f"the JSON holds {items} separators")
    depth = _depth(text)
    check_limit("json-depth", depth, limits.max_json_depth, f"the JSON nests {depth} deep")


def _depth(text: bytes) -> int:
    """How deep brackets and braces nest outside strings."""
    # Without escapes, which are rare, every second quote ends a string: no pattern need be matched.
    bare = _STRING.sub(b"", text) if b"\\" in text else text
    marks = _MARKS[np.frombuffer(bare, dtype=np.uint8)]
    marks = marks[marks != 0]
    outside = np.cumsum(marks == _QUOTE) % 2 == 0
    return int(np.cumsum(marks * (outside & (marks != _QUOTE)), dtype=np.int64).max(initial=0))
