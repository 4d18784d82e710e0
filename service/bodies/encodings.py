"""Content-Encoding: a body that its client has compressed."""

from __future__ import annotations

import zlib

from ..errors import MediaTypeError, UnreadableError, check_limit

IDENTITY, GZIP = "identity", "gzip"
# zlib's number for a gzip header and its checksum.
_GZIP_BITS = 31


def encoding_of(header: str) -> str:
    """Return the encoding that a Content-Encoding header names. Raises MediaTypeError."""
    encoding = header.strip().lower() or IDENTITY
    if encoding not in (IDENTITY, GZIP):
        raise MediaTypeError(f"Content-Encoding {encoding!r} is not supported; send {GZIP} or none")
    return encoding


def decoded(body: bytes, encoding: str, max_bytes: int) -> bytes:
    """Return a body as it was before its encoding.

    Raises:
        LimitError: it has more than `max_bytes`.
        UnreadableError: it is not gzip, ends too early, or something follows it.
    """
    if encoding == IDENTITY:
        return body
    stream = zlib.decompressobj(_GZIP_BITS)
    try:
        content = stream.decompress(body, max_bytes + 1)
    except zlib.error as error:
        raise UnreadableError(f"the body is not {GZIP}: {error}") from error
    text = f"the body unpacks to {len(content)} bytes or more"
    check_limit("body", len(content), max_bytes, text)
    if not stream.eof:
        raise UnreadableError(f"the body ends before its {GZIP} stream")
    if stream.unused_data:
        raise UnreadableError(f"{len(stream.unused_data)} bytes follow the {GZIP} stream")
    return content
