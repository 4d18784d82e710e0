"""Read and write the GLB container (glTF 2.0 §4): a header and chunks."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from ...bodies.media import GLB_MAGIC, begins_as_json
from ...errors import UnreadableError, check_limit
from ..constants import BIN_CHUNK, GLB_VERSION, JSON_CHUNK, WIDEST

_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_LARGEST = 2**32 - 1
# JSON, BIN and one for each extension that needs one. A file of chunk headers alone is an attack.
MAX_CHUNKS = 64


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
        raise UnreadableError("the file does not begin with the GLB magic 'glTF'")
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
