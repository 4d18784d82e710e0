"""Choose an answer's media type: the file, the file as plain bytes, or its report."""

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
