"""JSON text in and out: strict, and bounded before anything is decoded.

A decoder's cost is in the values it makes, not in the bytes it reads: 64 MiB of `{},` make tens of
millions of objects. So the characters that open or separate values are counted in the raw bytes
first (those inside strings too: the count may only err upwards), and so is the depth.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgspec
import numpy as np

from ...errors import GltfError, UnreadableError, check_limit
from ...options import BYTES_PER_INPUT_BYTE, Limits

# Possessive, and an unterminated string runs to the end: no quote is ever looked at twice, however
# hostile the text.
_QUOTE = 2
_MARKS = np.zeros(256, dtype=np.int8)
_MARKS[[ord(mark) for mark in '{["]}']] = [1, 1, _QUOTE, -1, -1]
# What is taken out of a text to count the rest.
_NO_ITEMS, _NO_MARKS = (bytes(set(range(256)) - set(kept)) for kept in (b'{[,:"', b'{["]}'))
# A node of two separators takes 233 bytes, with its typed view: the most of all that were measured.
BYTES_PER_ITEM = 128
# More for each byte of a string that is not ASCII: its widest letter says what each takes, up to
# four bytes, in the string and in what is told of it; and it is kept as UTF-8 once it was written.
BYTES_PER_WIDE_BYTE = 6
# Of brackets and quotes, whose depth is counted at a time.
_BLOCK = 2**18
BOM = b"\xef\xbb\xbf"
# Beyond every double; Python itself refuses to read 4,300 digits.
_LONG_INTEGER = re.compile(rb"(?<=[\s:,\[-])\d{310,}")
_LARGEST_INTEGER = 10**309
_ONE_DIGIT = bytes.maketrans(b"123456789", b"000000000")
_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+(?:"|\\?\Z)', re.DOTALL)


def decode_object(text: bytes, limits: Limits) -> dict[str, Any]:
    """Decode the JSON object that `text` holds.

    Raises:
        LimitError: too many values or too deep.
        UnreadableError: not JSON (RFC 8259; so no NaN or Infinity), or not UTF-8.
        GltfError: JSON, but not an object; or an integer beyond every double, by its pointer.
    """
    check_size(text, limits)
    value = _decoded(text.removeprefix(BOM))
    # All digits are made one: then a search in bytes is enough, where a pattern takes seconds.
    if 310 * b"0" in text.translate(_ONE_DIGIT):
        _refuse_long_integers(value)
    if not isinstance(value, dict):
        raise GltfError("the JSON's top level must be an object", pointer="")
    return value


def _decoded(text: bytes) -> Any:
    try:
        with _uncollected():
            return msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        # Digits without end are an error of their own; shorter ones in their place show where.
        shorter = _LONG_INTEGER.sub(b"1" + 310 * b"0", text)
        if isinstance(error, msgspec.ValidationError) and shorter != text:
            return _decoded(shorter)
        raise UnreadableError(f"the JSON cannot be decoded: {error}") from error


@contextmanager
def _uncollected() -> Iterator[None]:
    """Let the garbage collector rest: all that is decoded stays, and it would look at it often."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _refuse_long_integers(value: Any) -> None:
    pending: list[tuple[str, Any]] = [("", value)]
    while pending:
        pointer, part = pending.pop()
        if isinstance(part, int) and abs(part) >= _LARGEST_INTEGER:
            raise GltfError("an integer of more than 309 digits", pointer=pointer)
        if isinstance(part, dict):
            pending += [(f"{pointer}/{escaped(key)}", member) for key, member in part.items()]
        elif isinstance(part, list):
            pending += [(f"{pointer}/{number}", member) for number, member in enumerate(part)]


def escaped(name: str) -> str:
    """Return a key as one step of a JSON pointer (RFC 6901)."""
    return name.replace("~", "~0").replace("/", "~1")


def encode(value: Any) -> bytes:
    """Encode as compact UTF-8 JSON, keys in the order that they have."""
    return msgspec.json.encode(value)


def check_size(text: bytes, limits: Limits) -> None:
    """Count the values that a JSON text may hold, and how deep. Raises LimitError."""
    items = json_items(text)
    check_limit("json-items", items, limits.max_json_items, f"the JSON holds {items} separators")
    needed = BYTES_PER_INPUT_BYTE * len(text) + decoded_size(text)
    allowed = limits.max_memory_bytes
    check_limit("memory", needed, allowed, f"the decoded JSON would take {needed} bytes")
    depth = _depth(text)
    check_limit("json-depth", depth, limits.max_json_depth, f"the JSON nests {depth} deep")


def decoded_size(text: bytes) -> int:
    """Return the bytes that the decoded text and its typed view will take, erring upwards."""
    return BYTES_PER_ITEM * json_items(text) + BYTES_PER_WIDE_BYTE * _wide_bytes(text)


def _wide_bytes(text: bytes) -> int:
    """Return the bytes of the strings that hold more than ASCII, or may: an escape spells any."""
    if text.isascii() and b"\\u" not in text:
        return 0
    # Pairs of backslashes first: what is left of them escapes what follows.
    bare = text.replace(rb"\\", b"..").replace(rb"\"", b"..") if b"\\" in text else text
    strings = bare.split(b'"')[1::2]
    return sum(len(s) for s in strings if not s.isascii() or b"\\u" in s)


def json_items(text: bytes) -> int:
    """Return how many values a JSON text may hold, erring upwards."""
    return len(text.translate(None, _NO_ITEMS))


def _depth(text: bytes) -> int:
    """Return how deep brackets and braces nest outside strings.

    The decoder's own limit will not do: it is what the caller's stack leaves of Python's (997 of
    1,000, or 495 above 500 frames). A file would pass here, and fail there or when written.
    """
    # Without escapes, which are rare, every second quote ends a string: no pattern need be matched.
    bare = _STRING.sub(b"", text) if b"\\" in text else text
    # Two quotes beside each other leave what stands inside of strings inside, and outside outside.
    bare = bare.translate(None, _NO_MARKS).replace(b'""', b"")
    deepest, depth, inside = 0, 0, False
    # Block by block: in one go, a text of nothing but brackets would take 20 times its size.
    for start in range(0, len(bare), _BLOCK):
        block = bare[start : start + _BLOCK]
        marks = _MARKS[np.frombuffer(block, dtype=np.uint8)]
        quotes = marks == _QUOTE
        insides = np.logical_xor.accumulate(quotes) ^ inside
        depths = depth + np.where(insides | quotes, 0, marks).cumsum(dtype=np.int64)
        deepest = max(deepest, int(depths.max()))
        depth, inside = int(depths[-1]), bool(insides[-1])
    return deepest
