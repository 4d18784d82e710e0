"""Images in other files or in the JSON become part of the GLB, byte for byte: none is decoded."""

from __future__ import annotations

from typing import Any

from ...bodies.sibling_files import Opened, has_scheme
from ...report import Change
from .data_uri import data_of, is_data
from .schema import Document

# What a file of each type begins with (glTF 2.0 §3.8.2), and the extension that it needs.
_SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", 0, "image/png", None),
    (b"\xff\xd8\xff", 0, "image/jpeg", None),
    (b"\xabKTX 20\xbb\r\n\x1a\n", 0, "image/ktx2", "KHR_texture_basisu"),
    (b"WEBP", 8, "image/webp", "EXT_texture_webp"),
    (b"ftypavif", 4, "image/avif", "EXT_texture_avif"),
    (b"DDS ", 0, "image/vnd-ms.dds", "MSFT_texture_dds"),
)
_EXTENSION_OF = {kind: extension for _, _, kind, extension in _SIGNATURES}


def embed_images(
    tree: dict[str, Any], document: Document, buffers: list[memoryview], opened: Opened
) -> list[Change]:
    """Move the images that came with the document or in it into buffers; what was done to each.

    An image that did not come, or whose type is not known, keeps its URI. Edits the tree and
    appends to `buffers`.
    """
    changes: list[Change] = []
    for number, image in enumerate(document.images):
        pointer = f"/images/{number}"
        if image.uri is None:
            continue
        content = _content(image.uri, opened)
        if content is None:
            if not has_scheme(image.uri):
                # Where the result lies, its name may lead to nothing.
                changes.append(Change(pointer, _why_not(image.uri, opened), 1))
            continue
        kind = mime_type(content)
        if kind is None:
            if not is_data(image.uri):
                what = f"kept by its URI: {image.uri} is no known type of image"
                changes.append(Change(pointer, what, 1))
            continue
        extension = _EXTENSION_OF[kind]
        if extension is not None and extension not in document.extensions_used:
            # Embedded it would need a type that the file must not have.
            what = f"kept by its URI: {kind} without the extension {extension}"
            changes.append(Change(pointer, what, 1))
            continue
        entry = tree["images"][number]
        del entry["uri"]
        views = tree.setdefault("bufferViews", [])
        entry |= {"bufferView": len(views), "mimeType": kind}
        stored = tree.setdefault("buffers", [])
        views.append({"buffer": len(buffers), "byteLength": len(content)})
        stored.append({"byteLength": len(content)})
        buffers.append(content)
        changes.append(Change(pointer, "embedded", 1))
    return changes


def _content(uri: str, opened: Opened) -> memoryview | None:
    """Return the bytes behind an image's URI; None where they did not come."""
    if is_data(uri):
        try:
            return data_of(uri)
        except ValueError:
            return None
    file = opened.open(uri)
    return None if file is None else memoryview(file.content).cast("B")


def _why_not(uri: str, opened: Opened) -> str:
    if opened.name_of(uri) is None:
        return f"kept by its URI: {uri} leads out of the document's folder"
    return f"kept by its URI: {uri} did not come with the document"


def mime_type(content: memoryview) -> str | None:
    """Tell the type of an image by its first bytes."""
    for signature, offset, kind, _ in _SIGNATURES:
        if content[offset : offset + len(signature)] == signature:
            return kind
    return None
