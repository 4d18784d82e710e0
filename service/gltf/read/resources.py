"""Bytes behind buffers and images: BIN, `data:` URIs (RFC 2397), and files beside the document."""

from __future__ import annotations

import base64
import re
from typing import Any
from urllib.parse import quote

from ...bodies.sibling_files import Opened, has_scheme
from ...changes import Change
from ...errors import GltfError
from .compressed import needed_buffers
from .schema import Buffer, Document

_SCHEME = "data:"
_BASE64 = re.compile(r"data:[^,]*;base64,", re.IGNORECASE)
# First bytes of a file, where they stand, its image type (glTF 2.0 §3.8.2), and the extension that
# the type needs.
_SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", 0, "image/png", None),
    (b"\xff\xd8\xff", 0, "image/jpeg", None),
    (b"\xabKTX 20\xbb\r\n\x1a\n", 0, "image/ktx2", "KHR_texture_basisu"),
    (b"WEBP", 8, "image/webp", "EXT_texture_webp"),
    (b"ftypavif", 4, "image/avif", "EXT_texture_avif"),
    (b"DDS ", 0, "image/vnd-ms.dds", "MSFT_texture_dds"),
)
_EXTENSION_OF = {kind: extension for _, _, kind, extension in _SIGNATURES}


def resolve_buffers(
    document: Document, binary: memoryview | None, opened: Opened
) -> list[memoryview]:
    """Return the bytes of each buffer, exactly `byteLength` long.

    A data URI is longer than its bytes, so the limit of the body bounds them too.

    Raises:
        GltfError: a buffer with views has no bytes, or fewer than `byteLength`; its file did not
            come with the document; its URI leads elsewhere.
    """
    resolved: list[memoryview] = []
    needed = needed_buffers(document)
    for number, buffer in enumerate(document.buffers):
        pointer = f"/buffers/{number}"
        is_binary = number == 0 and binary is not None
        if buffer.uri is None and not is_binary and number not in needed:
            resolved.append(memoryview(b""))
            continue
        content = _buffer_bytes(buffer, binary if number == 0 else None, opened, pointer)
        if len(content) < buffer.byte_length:
            raise GltfError(
                f"byteLength is {buffer.byte_length}, but there are {len(content)} bytes",
                pointer=f"{pointer}/byteLength",
            )
        resolved.append(content[: buffer.byte_length])
    return resolved


def _buffer_bytes(
    buffer: Buffer, binary: memoryview | None, opened: Opened, pointer: str
) -> memoryview:
    if buffer.uri is None:
        if binary is None:
            raise GltfError("the buffer has neither a URI nor a BIN chunk", pointer=pointer)
        return binary
    pointer = f"{pointer}/uri"
    if is_data(buffer.uri):
        try:
            return _decoded(buffer.uri)
        except ValueError as error:
            raise GltfError(f"the data URI: {error}", pointer=pointer) from error
    name = opened.name_of(buffer.uri)
    if name is None:
        raise GltfError(
            f"{buffer.uri!r}: only files that come with the document, in its folder, are read",
            pointer=pointer,
            code="unsafe-uri",
        )
    file = opened.open(buffer.uri)
    if file is None:
        raise GltfError(
            f"the buffer's file {name!r} did not come with the document",
            pointer=pointer,
            code="missing-file",
        )
    return memoryview(file.content).cast("B")


def embed_images(
    tree: dict[str, Any], document: Document, buffers: list[memoryview], opened: Opened
) -> list[Change]:
    """Move images from files and data URIs into buffers, undecoded; return the changes.

    An image that did not come with the document, or of an unknown type, keeps its URI. Edits the
    tree and appends to `buffers`.
    """
    changes: list[Change] = []
    for number, image in enumerate(document.images):
        pointer = f"/images/{number}"
        if image.uri is None:
            continue
        content = _image_bytes(image.uri, opened)
        if content is None:
            if not has_scheme(image.uri):
                # Beside the result this name may lead to no file.
                why = _why_not(image.uri, opened)
                changes.append(Change(pointer, "kept-by-uri", 1, (why,)))
            continue
        kind = mime_type(content)
        if kind is None:
            if not is_data(image.uri):
                why = f"{image.uri} is no known type of image"
                changes.append(Change(pointer, "kept-by-uri", 1, (why,)))
            continue
        extension = _EXTENSION_OF[kind]
        if extension is not None and extension not in document.extensions_used:
            # Embedded, it would need a type that the file does not declare.
            why = f"{kind} without the extension {extension}"
            changes.append(Change(pointer, "kept-by-uri", 1, (why,)))
            continue
        entry = tree["images"][number]
        del entry["uri"]
        views = tree.setdefault("bufferViews", [])
        entry |= {"bufferView": len(views), "mimeType": kind}
        views.append({"buffer": len(buffers), "byteLength": len(content)})
        tree.setdefault("buffers", []).append({"byteLength": len(content)})
        buffers.append(content)
        changes.append(Change(pointer, "embedded", 1))
    return changes


def mime_type(content: memoryview) -> str | None:
    """Return the type of an image by its first bytes; None for an unknown one."""
    for signature, offset, kind, _ in _SIGNATURES:
        if content[offset : offset + len(signature)] == signature:
            return kind
    return None


def _image_bytes(uri: str, opened: Opened) -> memoryview | None:
    if is_data(uri):
        try:
            return _decoded(uri)
        except ValueError:
            return None
    file = opened.open(uri)
    return None if file is None else memoryview(file.content).cast("B")


def _why_not(uri: str, opened: Opened) -> str:
    if opened.name_of(uri) is None:
        return f"{uri} leads out of the document's folder"
    return f"{uri} did not come with the document"


def is_data(uri: str) -> bool:
    """Return whether a URI is a `data:` URI."""
    return uri[: len(_SCHEME)].lower() == _SCHEME


def _decoded(uri: str) -> memoryview:
    """Return the bytes of a data URI. Raises ValueError for another encoding than base64."""
    head = _BASE64.match(uri)
    if head is None:
        raise ValueError("it is not base64")
    encoded = uri[head.end() :]
    # Some writers percent-encode these. unquote() would take 180 bytes of memory for each `%`.
    for letter in "+/=":
        spelt = quote(letter, safe="")
        encoded = encoded.replace(spelt, letter).replace(spelt.lower(), letter)
    return memoryview(base64.b64decode(encoded + "=" * (-len(encoded) % 4), validate=True))
