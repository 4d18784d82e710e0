"""The page at `/` and the description at `/docs`: files of this package, as a browser gets them.

Every asset of the page has a hash of its content in its name, so a browser keeps it for ever. No
other host is asked for anything, and the policies would not let a page do it.
"""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import Response

from ..bodies.media import quality
from .answer import is_known

PAGE = Path(__file__).resolve().parent.parent / "web"
DOCS = Path(__file__).resolve().parent / "docs_ui"
DOCS_FILES = ("index.html", "start.js", "swagger-ui-bundle.js", "swagger-ui.css")
MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".glb": "model/gltf-binary",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".wasm": "application/wasm",
}

_NOTHING_ELSE = "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
PAGE_POLICY = (
    # The decoders of Draco and meshopt, and the transcoder of KTX2, are WebAssembly; textures are
    # cut out of the file, and fetched from there.
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self' blob:; worker-src 'self' blob:; "
) + _NOTHING_ELSE
DOCS_POLICY = (
    # Its style sheet carries its icons.
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; "
) + _NOTHING_ELSE
FOR_EVER = "public, max-age=31536000, immutable"
ASK_AGAIN = "no-cache"


def router(prefix: str = "") -> APIRouter:
    """Route the page and its assets, and the description and its files.

    Under a `prefix` the page names its assets from the root of the host: a browser that asked for
    the prefix without a slash at its end would look for them a folder too high.
    """
    # Names are looked up here, never joined to a path of the disk.
    files = {"/": (PAGE / "index.html", PAGE_POLICY), "/docs": (DOCS / "index.html", DOCS_POLICY)}
    files |= {f"/assets/{path.name}": (path, PAGE_POLICY) for path in (PAGE / "assets").iterdir()}
    files |= {f"/docs/{name}": (DOCS / name, DOCS_POLICY) for name in DOCS_FILES}
    routes = APIRouter(include_in_schema=False)

    # No coroutine: to compress a file takes longer than a probe should wait for.
    @routes.get("/")
    @routes.get("/assets/{name}")
    @routes.get("/docs")
    @routes.get("/docs/{name}")
    def file(request: Request) -> Response:
        path = request.scope["path"].removeprefix(request.scope["root_path"])
        if path not in files:
            raise HTTPException(404, "the page has no such file")
        source, policy = files[path]
        sent = _read(source, prefix if path == "/" else "")
        headers = {
            "Cache-Control": FOR_EVER if path.startswith("/assets/") else ASK_AGAIN,
            "Content-Security-Policy": policy,
            # Weak: both encodings have it (RFC 9110, 8.8.1).
            "ETag": f"W/{sent.tag}",
            "Referrer-Policy": "no-referrer",
            "Vary": "Accept-Encoding",
        }
        if is_known(sent.tag, request):
            return Response(status_code=304, headers=headers)
        content = sent.content
        if quality("gzip", request.headers.get("accept-encoding", "")):
            content = sent.packed
            headers["Content-Encoding"] = "gzip"
        return Response(content, headers=headers, media_type=sent.media_type)

    return routes


@dataclass(frozen=True)
class _File:
    content: bytes
    packed: bytes
    media_type: str
    tag: str


@cache
def _read(path: Path, prefix: str = "") -> _File:
    content = path.read_bytes()
    if prefix:
        content = content.replace(b'="assets/', f'="{prefix}/assets/'.encode())
    tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
    return _File(content, gzip.compress(content, mtime=0), MEDIA_TYPES[path.suffix], tag)
