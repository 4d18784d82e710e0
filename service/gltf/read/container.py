"""Read and write the GLB container (glTF 2.0 §4) and its JSON, with limits before decoding.

A decoder's cost is in the values that it makes: 64 MiB of `{},` make tens of millions of objects.
So the raw bytes are searched first for the characters that open or separate values.
"""

from __future__ import annotations

import gc
import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from ...bodies.media import GLB_MAGIC, begins_as_json
from ...errors import GltfError, UnreadableError, check_limit, quoted
from ...options import BYTES_PER_INPUT_BYTE, Limits
from ..constants import BIN_CHUNK, GLB_VERSION, JSON_CHUNK, WIDEST

_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_LARGEST = 2**32 - 1
# JSON, BIN and one for each extension that needs one. A file of chunk headers alone is an attack.
MAX_CHUNKS = 64
BOM = b"\xef\xbb\xbf"
# Bytes of a decoded value. The most that was measured is 233, for a node of two separators with its
# typed view.
BYTES_PER_ITEM = 128
# More bytes for each byte of a string that is not ASCII: its widest character takes up to four
# bytes for all of them, and msgspec keeps the UTF-8 form after encoding.
BYTES_PER_WIDE_BYTE = 6

_QUOTE = 2
_MARKS = np.zeros(256, dtype=np.int8)
_MARKS[[ord(mark) for mark in '{["]}']] = [1, 1, _QUOTE, -1, -1]
# Deleting these bytes leaves the items, or the brackets and quotes.
_NO_ITEMS, _NO_MARKS = (bytes(set(range(256)) - set(kept)) for kept in (b'{[,:"', b'{["]}'))
# Brackets and quotes whose depth is computed at a time.
_BLOCK = 2**18
# Longer integers exceed every double. Python refuses to read 4,300 digits.
_LONG_INTEGER = re.compile(rb"(?<=[\s:,\[-])\d{310,}")
_LARGEST_INTEGER = 10**309
_ONE_DIGIT = bytes.maketrans(b"123456789", b"000000000")
# Possessive, and an unterminated string runs to the end: hostile text costs linear time.
_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+(?:"|\\?\Z)', re.DOTALL)


def decode_object(text: bytes, limits: Limits) -> dict[str, Any]:
    """Decode a JSON object.

    Raises:
        LimitError: too many values, or nested too deep.
        UnreadableError: not JSON (RFC 8259: no NaN or Infinity), or not UTF-8.
        GltfError: JSON but no object, or an integer beyond every double, with its pointer.
    """
    check_size(text, limits)
    value = _decoded(text.removeprefix(BOM))
    # With all digits made equal, a search of bytes replaces a pattern that takes seconds.
    if 310 * b"0" in text.translate(_ONE_DIGIT):
        _refuse_long_integers(value)
    if not isinstance(value, dict):
        raise GltfError("the JSON's top level must be an object", pointer="")
    return value


def _decoded(text: bytes) -> Any:
    try:
        with _without_garbage_collection():
            return msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        # msgspec fails on too many digits without their place; decode shorter ones to find it.
        shorter = _LONG_INTEGER.sub(b"1" + 310 * b"0", text)
        if isinstance(error, msgspec.ValidationError) and shorter != text:
            return _decoded(shorter)
        raise UnreadableError(f"the JSON cannot be decoded: {error}") from error


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Disable the garbage collector, which would scan the growing tree often and free nothing."""
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
    """Return a key as a step of a JSON pointer (RFC 6901)."""
    return name.replace("~", "~0").replace("/", "~1")


def encode(value: Any) -> bytes:
    """Encode compact UTF-8 JSON; keys keep their order."""
    return msgspec.json.encode(value)


def check_size(text: bytes, limits: Limits) -> None:
    """Check the number of values in a JSON text, their memory and depth. Raises LimitError."""
    items = json_items(text)
    check_limit("json-items", items, limits.max_json_items, f"the JSON holds {items} separators")
    needed = BYTES_PER_INPUT_BYTE * len(text) + decoded_size(text)
    allowed = limits.max_memory_bytes
    check_limit("memory", needed, allowed, f"the decoded JSON would take {needed} bytes")
    depth = _depth(text)
    check_limit("json-depth", depth, limits.max_json_depth, f"the JSON nests {depth} deep")


def decoded_size(text: bytes) -> int:
    """Return an upper bound of the bytes that the decoded text and its typed view take."""
    return BYTES_PER_ITEM * json_items(text) + BYTES_PER_WIDE_BYTE * _wide_bytes(text)


def json_items(text: bytes) -> int:
    """Return an upper bound of the number of values in a JSON text."""
    return len(text.translate(None, _NO_ITEMS))


def _wide_bytes(text: bytes) -> int:
    """Return the bytes of the strings that may hold more than ASCII; an escape may spell any."""
    if text.isascii() and b"\\u" not in text:
        return 0
    # Pairs of backslashes first: a backslash that is left escapes the next character.
    bare = text.replace(rb"\\", b"..").replace(rb"\"", b"..") if b"\\" in text else text
    strings = bare.split(b'"')[1::2]
    return sum(len(s) for s in strings if not s.isascii() or b"\\u" in s)


def _depth(text: bytes) -> int:
    """Return how deep brackets and braces nest outside strings.

    The decoder's own limit depends on the caller's stack (997 of 1,000 levels, or 495 above 500
    frames): a file could pass here and fail when it is written.
    """
    # Escapes are rare. Without them every second quote ends a string, and no pattern is needed.
    bare = _STRING.sub(b"", text) if b"\\" in text else text
    # Removing two adjacent quotes leaves the inside of strings inside, and the outside outside.
    bare = bare.translate(None, _NO_MARKS).replace(b'""', b"")
    deepest, depth, inside = 0, 0, False
    # In blocks: a text of brackets alone would take 20 times its size in one go.
    for start in range(0, len(bare), _BLOCK):
        block = bare[start : start + _BLOCK]
        marks = _MARKS[np.frombuffer(block, dtype=np.uint8)]
        quotes = marks == _QUOTE
        insides = np.logical_xor.accumulate(quotes) ^ inside
        depths = depth + np.where(insides | quotes, 0, marks).cumsum(dtype=np.int64)
        deepest = max(deepest, int(depths.max()))
        depth, inside = int(depths[-1]), bool(insides[-1])
    return deepest


@dataclass(frozen=True)
class Container:
    """A GLB's chunks.

    Attributes:
        text: the JSON chunk.
        binary: the BIN chunk; None without one.
        others: (type, data) of the chunks after it. They belong to extensions and are kept.
        tail: number of bytes after the GLB, which are no part of it.
    """

    text: bytes
    binary: memoryview | None = None
    others: tuple[tuple[bytes, memoryview], ...] = ()
    tail: int = 0


def read_container(data: bytes, kind: str) -> Container:
    """Read a .glb or a .gltf, whose container is its text; the first bytes decide which it is.

    Raises:
        UnreadableError, LimitError: as `read_glb`.
    """
    if data.startswith(GLB_MAGIC) or (kind == "glb" and not begins_as_json(data)):
        return read_glb(data)
    return Container(text=data)


def read_glb(data: bytes | memoryview) -> Container:
    """Split a GLB into its chunks, without copying BIN.

    Raises:
        UnreadableError: not a GLB of version 2, or its lengths do not match the bytes.
        LimitError: more than MAX_CHUNKS chunks.
    """
    if len(data) < _HEADER.size:
        raise UnreadableError("the file is shorter than a GLB header")
    magic, version, length = _HEADER.unpack_from(data)
    if magic != GLB_MAGIC:
        raise UnreadableError(f"this is not a glTF file: it begins with {quoted(data)}")
    if version != GLB_VERSION:
        raise UnreadableError(f"GLB version {version}, expected {GLB_VERSION}")
    if not _HEADER.size <= length <= len(data):
        short = ": the file is cut short" if length > len(data) else ""
        text = f"the GLB header says {length} bytes, the file has {len(data)}{short}"
        raise UnreadableError(text)
    chunks = _chunks(memoryview(data)[:length])
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise UnreadableError("the first chunk of the GLB is not JSON")
    rest = chunks[1:]
    binary = rest[0][1] if rest and rest[0][0] == BIN_CHUNK else None
    others = rest if binary is None else rest[1:]
    return Container(bytes(chunks[0][1]), binary, tuple(others), len(data) - length)


def write_glb(
    text: bytes, binary: Sequence[bytes | memoryview], others: Sequence[tuple[bytes, memoryview]]
) -> bytes:
    """Write a GLB: the JSON `text`, the pieces of the BIN chunk, and further chunks.

    BIN begins at a multiple of WIDEST bytes, as EXT_structural_metadata requires.

    Raises:
        LimitError: the result would exceed the 4 GiB of a GLB.
    """
    spaces = b" " * (-(_HEADER.size + _CHUNK.size + len(text)) % WIDEST)
    pieces = [*_padded_chunk(JSON_CHUNK, [text, spaces], b" ")]
    if binary:
        pieces += _padded_chunk(BIN_CHUNK, binary, b"\0")
    for kind, data in others:
        pieces += _padded_chunk(kind, [data], b"\0")
    length = _HEADER.size + sum(len(piece) for piece in pieces)
    check_limit("glb-bytes", length, _LARGEST, f"the refined GLB would have {length} bytes")
    return b"".join([_HEADER.pack(GLB_MAGIC, GLB_VERSION, length), *pieces])


def _chunks(data: memoryview) -> list[tuple[bytes, memoryview]]:
    chunks: list[tuple[bytes, memoryview]] = []
    offset = _HEADER.size
    while offset < len(data):
        if offset + _CHUNK.size > len(data):
            raise UnreadableError(f"the chunk header at byte {offset} is cut off")
        length, kind = _CHUNK.unpack_from(data, offset)
        start = offset + _CHUNK.size
        if start + length > len(data):
            raise UnreadableError(
                f"the chunk at byte {offset} says {length} bytes, {len(data) - start} are left"
            )
        count = len(chunks) + 1
        check_limit("glb-chunks", count, MAX_CHUNKS, f"the GLB has {count} chunks or more")
        chunks.append((kind, data[start : start + length]))
        offset = start + length
    return chunks


def _padded_chunk(
    kind: bytes, pieces: Sequence[bytes | memoryview], filler: bytes
) -> list[bytes | memoryview]:
    length = sum(len(piece) for piece in pieces)
    padding = -length % 4
    return [_CHUNK.pack(min(length + padding, _LARGEST), kind), *pieces, filler * padding]
