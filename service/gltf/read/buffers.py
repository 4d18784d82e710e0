"""The bytes behind `buffers[]`: BIN, base64 data URIs, and files that came with the document."""

from __future__ import annotations

from ...bodies.sibling_files import Opened
from ...errors import GltfError
from .compressed.meshopt import needed_buffers
from .data_uri import data_of, is_data
from .schema import Buffer, Document


def resolve_buffers(
    document: Document, binary: memoryview | None, opened: Opened
) -> list[memoryview]:
    """Return the bytes of each buffer, exactly `byteLength` long.

    A data URI's bytes are fewer than its characters, so the body's limit bounds them too.

    Raises:
        GltfError: no bytes where views lie, or fewer than `byteLength` says; a file that did not
            come, or a URI that leads elsewhere.
    """
    resolved: list[memoryview] = []
    needed = needed_buffers(document)
    for number, buffer in enumerate(document.buffers):
        pointer = f"/buffers/{number}"
        is_binary = number == 0 and binary is not None
        if buffer.uri is None and not is_binary and number not in needed:
            resolved.append(memoryview(b""))
            continue
        content = _content(buffer, binary if number == 0 else None, opened, pointer)
        if len(content) < buffer.byte_length:
            raise GltfError(
                f"byteLength is {buffer.byte_length}, but there are {len(content)} bytes",
                pointer=f"{pointer}/byteLength",
            )
        resolved.append(content[: buffer.byte_length])
    return resolved


def _content(buffer: Buffer, binary: memoryview | None, opened: Opened, pointer: str) -> memoryview:
    if buffer.uri is None:
        if binary is None:
            raise GltfError("the buffer has neither a URI nor a BIN chunk", pointer=pointer)
        return binary
    if not is_data(buffer.uri):
        return _neighbour(buffer.uri, opened, f"{pointer}/uri")
    try:
        return data_of(buffer.uri)
    except ValueError as error:
        raise GltfError(f"the data URI: {error}", pointer=f"{pointer}/uri") from error


def _neighbour(uri: str, opened: Opened, pointer: str) -> memoryview:
    name = opened.name_of(uri)
    if name is None:
        raise GltfError(
            f"{uri!r}: only files that come with the document, in its folder, are read",
            pointer=pointer,
            code="unsafe-uri",
        )
    file = opened.open(uri)
    if file is None:
        raise GltfError(
            f"the buffer's file {name!r} did not come with the document",
            pointer=pointer,
            code="missing-file",
        )
    return memoryview(file.content).cast("B")
