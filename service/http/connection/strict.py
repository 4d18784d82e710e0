"""What h11 takes and two readers may take differently: refused, so that none reads a request here
that another, in front, has read as a body (RFC 9112 §§2.2, 5.2, 6.1, 11.2)."""

from __future__ import annotations

import re

import h11

# An end of line without its CR, or a line that goes on from the one before.
_LOOSE = re.compile(rb"(?<!\r)\n|\n[ \t]")


def check_request(request: h11.Request, head: bytes, longest: int) -> None:
    """Check a request's head, as it was parsed and as it came.

    Raises:
        h11.RemoteProtocolError: it is too long, of another protocol, or says twice how long its
            body is.
    """
    if len(head) > longest:
        raise h11.RemoteProtocolError("the head is too long", error_status_hint=431)
    if not request.http_version.startswith(b"1."):
        raise h11.RemoteProtocolError("HTTP/1.0 and 1.1 are spoken here", error_status_hint=505)
    check_lines(head)
    if is_chunked(request):
        if any(name == b"content-length" for name, _ in request.headers):
            raise h11.RemoteProtocolError("both Content-Length and Transfer-Encoding")
        if request.http_version == b"1.0":
            raise h11.RemoteProtocolError("Transfer-Encoding, which HTTP/1.0 does not have")


def check_lines(lines: bytes) -> None:
    """Check how the lines of a head, or of what follows a chunked body, end.

    Raises:
        h11.RemoteProtocolError: one ends without CR, or goes on from the one before.
    """
    if _LOOSE.search(lines):
        raise h11.RemoteProtocolError("lines end with CR and LF, and none goes on in the next")


def is_chunked(request: h11.Request) -> bool:
    """Return whether its body comes in chunks: h11 takes no other transfer encoding."""
    return any(name == b"transfer-encoding" for name, _ in request.headers)
