"""A request's target in absolute form (`GET http://host/path`), which is served as its path.

A server takes it from every client, though only those of a proxy send it, and its host stands for
what the Host line says (RFC 9112 §3.2.2).
"""

from __future__ import annotations

import re

import h11

_ABSOLUTE = re.compile(rb"https?://([^/?#]*)(.*)", re.IGNORECASE)
# A name or an IPv4 address, or an IPv6 address, and a port; no user, and none of them empty
# (RFC 9110 §4.2).
_AUTHORITY = re.compile(rb"(?:[\w.~!$&'()*+,;=%-]+|\[[0-9A-Fa-f:.]+\])(?::[0-9]*)?")


def origin_form(request: h11.Request) -> h11.Request:
    """Return the request with its path alone for a target; one that has no other is handed back.

    Raises:
        h11.RemoteProtocolError: the target names no host, or more than a host and a port.
    """
    target = _ABSOLUTE.fullmatch(request.target)
    if target is None:
        return request
    host, rest = target.groups()
    if not _AUTHORITY.fullmatch(host):
        raise h11.RemoteProtocolError("the request's target names no host")
    headers = [pair for pair in request.headers if pair[0] != b"host"]
    return h11.Request(
        method=request.method,
        headers=[(b"host", host), *headers],
        target=rest if rest.startswith(b"/") else b"/" + rest,
        http_version=request.http_version,
    )
