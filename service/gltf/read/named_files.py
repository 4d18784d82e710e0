"""The files that a document names, found without reading the rest of it."""

from __future__ import annotations

from typing import Any

from ...bodies.media import GLTF_KINDS
from ...bodies.sibling_files import safe_name
from ...errors import ServiceError
from ...options import Limits
from .container import Container, read_glb
from .json_text import decode_object


def named_files(data: bytes, kind: str, limits: Limits) -> list[str]:
    """Return the names of buffers' and images' files, each once; none of what cannot be read."""
    if kind not in GLTF_KINDS:
        return []
    try:
        text = (read_glb(data) if kind == "glb" else Container(text=data)).text
        # Most files hold all that is theirs; an escape could spell the word too.
        if b'"uri"' not in text and b"\\u" not in text:
            return []
        tree = decode_object(text, limits)
    except ServiceError:
        # Refining it says why.
        return []
    names = (_name(entry) for key in ("buffers", "images") for entry in _entries(tree.get(key)))
    return list(dict.fromkeys(name for name in names if name is not None))


def _entries(values: Any) -> list[Any]:
    return values if isinstance(values, list) else []


def _name(entry: Any) -> str | None:
    uri = entry.get("uri") if isinstance(entry, dict) else None
    return safe_name(uri) if isinstance(uri, str) else None
