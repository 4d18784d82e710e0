"""The bytes behind `buffers[]`: BIN and base64 data URIs. No other URI is ever followed."""

from __future__ import annotations

import base64
import re

from service.errors import GltfError, UnsupportedFeature
from service.gltf.meshopt import placeholders
from service.gltf.schema import Buffer, Document

_DATA_URI = re.compile(r"data:[^,]*;base64,", re.IGNORECASE)


def resolve_buffers(document: Document, binary: memoryview | None) -> list[memoryview]:
    """The bytes of each buffer, exactly `byteLength` long.

    A data URI's bytes are fewer than its characters, so the body's limit bounds them too.

    Raises:
        UnsupportedFeature: a buffer in another file.
        GltfError: no bytes, or fewer than `byteLength` says.
    """
    resolved: list[memoryview] = []
    without = placeholders(document)
    for number, buffer in enumerate(document.buffers):
        pointer = f"/buffers/{number}"
        is_binary = number == 0 and binary is not None
        if buffer.uri is None and not is_binary and number in without:
            resolved.append(memoryview(b""))
            continue
        content = _content(buffer, binary if number == 0 else None, pointer)
        if len(content) < buffer.byte_length:
            raise GltfError(
                f"byteLength is {buffer.byte_length}, but there are {len(content)} bytes",
                pointer=f"{pointer}/byteLength",
            )
        resolved.append(content[: buffer.byte_length])
    return resolved


def _content(buffer: Buffer, binary: memoryview | None, pointer: str) -> memoryview:
    if buffer.uri is None:
        if binary is None:
            raise GltfError("the buffer has neither a URI nor a BIN chunk", pointer=pointer)
        return binary
    if not buffer.uri[:5].lower() == "data:":
        raise UnsupportedFeature("a buffer in an external file", pointer=f"{pointer}/uri")
    scheme = _DATA_URI.match(buffer.uri)
    if scheme is None:
        raise GltfError("the data URI is not base64", pointer=f"{pointer}/uri")
    encoded = buffer.uri[scheme.end() :]
    try:
        return memoryview(base64.b64decode(encoded + "=" * (-len(encoded) % 4), validate=True))
    except ValueError as error:
        raise GltfError(f"the data URI: {error}", pointer=f"{pointer}/uri") from error
