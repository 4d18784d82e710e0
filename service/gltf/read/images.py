"""Images in other files become part of the GLB, byte for byte: none is ever decoded."""

from __future__ import annotations

from typing import Any

from ...bodies.sibling_files import Opened, has_scheme
from ...report import Change
from .schema import Document

# What a file of each type begins with (glTF 2.0 §3.8.2, KHR_texture_basisu, EXT_texture_webp,
# EXT_texture_avif, MSFT_texture_dds).
_SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", 0, "image/png"),
    (b"\xff\xd8\xff", 0, "image/jpeg"),
    (b"\xabKTX 20\xbb\r\n\x1a\n", 0, "image/ktx2"),
    (b"WEBP", 8, "image/webp"),
    (b"ftypavif", 4, "image/avif"),
    (b"DDS ", 0, "image/vnd-ms.dds"),
)


def embed_images(
    tree: dict[str, Any], document: Document, buffers: list[memoryview], opened: Opened
) -> list[Change]:
    """Move the images that came with the document into buffers; what was done to each.

    An image that did not come, or whose type is not known, keeps its URI. Edits the tree and
    appends to `buffers`.
    """
    changes: list[Change] = []
    for number, image in enumerate(document.images):
        pointer = f"/images/{number}"
        if image.uri is None or image.uri[:5].lower() == "data:":
            continue
        file = opened.open(image.uri)
        if file is None:
            if not has_scheme(image.uri):
                # Where the result lies, its name may lead to nothing.
                what = "kept by its URI: it did not come with the document"
                changes.append(Change(pointer, what, 1))
            continue
        content = memoryview(file.content).cast("B")
        kind = mime_type(content)
        if kind is None:
            changes.append(Change(pointer, "kept by its URI: no known type of image", 1))
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


def mime_type(content: memoryview) -> str | None:
    """Tell the type of an image by its first bytes."""
    for signature, offset, kind in _SIGNATURES:
        if content[offset : offset + len(signature)] == signature:
            return kind
    return None
