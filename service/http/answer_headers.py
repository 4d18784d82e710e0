"""Write headers of answers: the media type, and how long each stage of a job took."""

from __future__ import annotations

from fastapi import Request

from ..bodies import media


def answer_type(request: Request, file_type: str = media.GLB) -> str:
    """Return the media type that the client wants most; `file_type` is that of the file.

    Generated clients know a file by `application/octet-stream` alone, and may ask for that.
    """
    # Several lines of it are one; without any, all are equal.
    accept = ",".join(request.headers.getlist("accept"))
    # In the order of preference among equals.
    return max((file_type, media.JSON, media.BYTES), key=lambda kind: media.quality(kind, accept))


def server_timing(seconds: dict[str, float]) -> str:
    """Return the value of `Server-Timing`: milliseconds by stage."""
    return ", ".join(f"{stage};dur={1000 * value:.1f}" for stage, value in seconds.items())
