"""The page: the files of `service/web`, built from `web/`.

Every file but index.html has a hash of its content in its name, so a browser keeps it for ever.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import Response

from .static_files import FOR_EVER, StaticFile, answer, static_file

FOLDER = Path(__file__).resolve().parent.parent / "web"

POLICY = "; ".join(
    [
        "default-src 'none'",
        # The decoders of Draco and meshopt, and the transcoder of KTX2, are WebAssembly.
        "script-src 'self' 'wasm-unsafe-eval'",
        "style-src 'self'",
        # Textures are cut out of the file, and fetched from there.
        "img-src 'self' blob: data:",
        "connect-src 'self' blob:",
        "worker-src 'self' blob:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    ]
)


def router(prefix: str = "") -> APIRouter:
    """Route the page at `/`, and its assets.

    Under a `prefix` the page names them from the root of the host: a browser that asked for the
    prefix without a slash at its end would look for them a folder too high.
    """
    routes = APIRouter(include_in_schema=False)

    @routes.get("/")
    def page(request: Request) -> Response:
        return answer(request, _page(prefix), POLICY)

    @routes.get("/assets/{name}")
    def asset(request: Request, name: str) -> Response:
        path = f"assets/{name}"
        if path not in _paths():
            raise HTTPException(404, f"the page has no file {path}")
        return answer(request, _read(path), POLICY, FOR_EVER)

    return routes


@cache
def _paths() -> frozenset[str]:
    """List what may be asked for: names are looked up here, never joined to a path of the disk."""
    return frozenset(
        str(path.relative_to(FOLDER).as_posix()) for path in FOLDER.rglob("*") if path.is_file()
    )


@cache
def _page(prefix: str) -> StaticFile:
    content = (FOLDER / "index.html").read_bytes()
    if prefix:
        content = content.replace(b'="assets/', f'="{prefix}/assets/'.encode())
    return static_file(content, ".html")


@cache
def _read(path: str) -> StaticFile:
    return static_file((FOLDER / path).read_bytes(), Path(path).suffix)
