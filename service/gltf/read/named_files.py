"""The files that a document names, found without reading the rest of it."""

from __future__ import annotations

from typing import Any

from ...bodies.media import GLTF_KINDS
from ...bodies.sibling_files import has_scheme
from ...errors import ServiceError
from ...options import Limits
from .container import read_container
from .json_text import decode_object


def named_files(data: bytes, kind: str, limits: Limits) -> list[str]:
    """Return the relative URIs of buffers and images, each once; none of what cannot be read."""
    if kind not in GLTF_KINDS:
        return []
    try:
        text = read_container(data, kind).text
        # Most files hold all that is theirs; an escape could spell the word too.
        if b'"uri"' not in text and b"\\u" not in text:
            return []
        tree = decode_object(text, limits)
    except ServiceError:
        # Refining it says why.
        return []
    uris = (_uri(entry) for key in ("buffers", "images") for entry in _entries(tree.get(key)))
    return list(dict.fromkeys(uri for uri in uris if uri is not None and not has_scheme(uri)))


def _entries(values: Any) -> list[Any]:
    return values if isinstance(values, list) else []


def _uri(entry: Any) -> str | None:
    uri = entry.get("uri") if isinstance(entry, dict) else None
    return uri if isinstance(uri, str) else None
