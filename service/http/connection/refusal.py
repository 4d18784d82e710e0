"""The answer to what never became a request: bytes, for there is no application to make them."""

from __future__ import annotations

import json
from http import HTTPStatus


def refusal(status: int, code: str, detail: str, more: bytes = b"") -> bytes:
    """Return a whole answer, a problem that ends the connection; `more` are lines of its head."""
    phrase = HTTPStatus(status).phrase
    document = {
        "type": f"urn:pns:problem:{code}",
        "title": phrase,
        "status": status,
        "detail": detail,
        "code": code,
    }
    body = json.dumps(document).encode()
    head = f"HTTP/1.1 {status} {phrase}\r\ncontent-type: application/problem+json\r\n".encode()
    head += b"x-content-type-options: nosniff\r\n"
    return head + more + b"content-length: %d\r\nconnection: close\r\n\r\n" % len(body) + body
