"""/docs: the description of the service, shown by Swagger UI from files of this package.

No other host is asked for anything, and the page's policy would not let it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import Response

from .static_files import StaticFile, answer, static_file

FOLDER = Path(__file__).resolve().parent / "docs_ui"
PAGE = "index.html"
FILES = (PAGE, "start.js", "swagger-ui-bundle.js", "swagger-ui.css")
POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        # Its style sheet carries its icons.
        "img-src 'self' data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    ]
)


def router() -> APIRouter:
    """Route the page at `/docs`, and its files under it."""
    routes = APIRouter(include_in_schema=False)
    # Read and compressed now: it takes longer than a probe should wait for.
    for name in FILES:
        _read(name)

    @routes.get("/docs")
    async def docs(request: Request) -> Response:
        return answer(request, _read(PAGE), POLICY)

    @routes.get("/docs/{name}")
    async def docs_file(request: Request, name: str) -> Response:
        if name not in FILES:
            raise HTTPException(404, "the page has no such file")
        return answer(request, _read(name), POLICY)

    return routes


@cache
def _read(name: str) -> StaticFile:
    return static_file((FOLDER / name).read_bytes(), Path(name).suffix)
