"""Files of this package as a browser gets them: compressed, tagged, and under a policy."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass

from starlette.requests import Request
from starlette.responses import Response

from ..bodies.media import quality

MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".glb": "model/gltf-binary",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".wasm": "application/wasm",
}

FOR_EVER = "public, max-age=31536000, immutable"
ASK_AGAIN = "no-cache"


@dataclass(frozen=True)
class StaticFile:
    """A file as it is sent."""

    content: bytes
    packed: bytes
    media_type: str
    tag: str


def static_file(content: bytes, suffix: str) -> StaticFile:
    """Return a file of these bytes, of the type that its suffix says."""
    return StaticFile(
        content=content,
        packed=gzip.compress(content, mtime=0),
        media_type=MEDIA_TYPES[suffix],
        tag=f'"{hashlib.sha256(content).hexdigest()[:32]}"',
    )


def answer(request: Request, file: StaticFile, policy: str, caching: str = ASK_AGAIN) -> Response:
    """Answer with the file, or that the browser has it; ``policy``: what a page may load."""
    headers = {
        "Cache-Control": caching,
        "Content-Security-Policy": policy,
        # Weak: both encodings have it (RFC 9110, 8.8.1).
        "ETag": f"W/{file.tag}",
        "Referrer-Policy": "no-referrer",
        "Vary": "Accept-Encoding",
    }
    known = request.headers.get("if-none-match", "")
    if file.tag in {tag.strip().removeprefix("W/") for tag in known.split(",")} or known == "*":
        return Response(status_code=304, headers=headers)
    content = file.content
    if quality("gzip", request.headers.get("accept-encoding", "")):
        content = file.packed
        headers["Content-Encoding"] = "gzip"
    return Response(content, headers=headers, media_type=file.media_type)
