"""Decompress a request's body that came by gzip, piece by piece."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

from ..errors import MediaTypeError, UnreadableError, check_limit

# The most that one step makes of a piece: the event loop has other turns between steps.
STEP_BYTES = 2**18
_GZIP = 16 + zlib.MAX_WBITS


class Identity:
    """Pass a body through."""

    def pieces(self, piece: bytes) -> Iterator[bytes]:
        """Yield the piece itself."""
        yield piece

    def end(self) -> None:
        """Accept any end."""


class Gunzip:
    """Decompress a body of one gzip member into at most `max_bytes`."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._size = 0
        self._stream = zlib.decompressobj(_GZIP)

    def pieces(self, piece: bytes) -> Iterator[bytes]:
        """Yield what a piece decompresses to, in steps.

        Raises:
            UnreadableError: the body is no gzip, or goes on after its end.
            LimitError: it decompresses to more than `max_bytes`.
        """
        stream, made = self._stream, b""
        # A full step may leave output behind in the stream, although it took all of the input.
        while piece or len(made) == STEP_BYTES:
            if stream.eof and piece:
                raise UnreadableError("the body goes on after the end of its gzip member")
            try:
                made = stream.decompress(piece, STEP_BYTES)
            except zlib.error as error:
                raise UnreadableError(f"the body is no gzip: {error}") from error
            self._size += len(made)
            text = f"the body decompresses to {self._size} bytes or more"
            check_limit("body", self._size, self._max_bytes, text)
            yield made
            piece = stream.unused_data if stream.eof else stream.unconsumed_tail

    def end(self) -> None:
        """Raise UnreadableError where the body ended before its gzip member did."""
        if not self._stream.eof:
            raise UnreadableError("the gzip body ends too early")


def decoder(content_encoding: str, max_bytes: int) -> Identity | Gunzip:
    """Return the decoder that a Content-Encoding header names. Raises MediaTypeError."""
    match content_encoding.strip().lower():
        case "" | "identity":
            return Identity()
        case "gzip" | "x-gzip":
            return Gunzip(max_bytes)
        case other:
            raise MediaTypeError(f"Content-Encoding {other!r} is not supported; send gzip or none")
