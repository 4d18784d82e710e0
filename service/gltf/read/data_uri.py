"""Bytes that a document holds in its JSON, as `data:` URIs (RFC 2397)."""

from __future__ import annotations

import base64
import re
from urllib.parse import quote

_SCHEME = "data:"
_BASE64 = re.compile(r"data:[^,]*;base64,", re.IGNORECASE)


def is_data(uri: str) -> bool:
    """Return whether a URI holds the bytes that it names."""
    return uri[: len(_SCHEME)].lower() == _SCHEME


def data_of(uri: str) -> memoryview:
    """Return the bytes in a data URI, which are fewer than its characters.

    Raises:
        ValueError: they are not base64, the only form that glTF knows.
    """
    head = _BASE64.match(uri)
    if head is None:
        raise ValueError("it is not base64")
    encoded = uri[head.end() :]
    # Some writers spell these by their numbers. Not unquote: it takes 180 bytes for each `%`.
    for letter in "+/=":
        spelt = quote(letter, safe="")
        encoded = encoded.replace(spelt, letter).replace(spelt.lower(), letter)
    return memoryview(base64.b64decode(encoded + "=" * (-len(encoded) % 4), validate=True))
