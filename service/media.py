"""Content types: which bodies are taken, and what a file is by its first bytes."""

from __future__ import annotations

from service.errors import MediaTypeError

GLB = "model/gltf-binary"
GLTF = "model/gltf+json"
MULTIPART = "multipart/form-data"
ACCEPTED = (GLB, GLTF, MULTIPART)

FORMATS = {GLB: "glb", GLTF: "gltf"}
"""The pipeline's name of each file type."""

GLB_MAGIC = b"glTF"
BLANK = b" \t\r\n"


def of_request(content_type: str) -> str:
    """The media type that a Content-Type names, without its parameters. Raises MediaTypeError."""
    media = content_type.partition(";")[0].strip().lower()
    if media not in ACCEPTED:
        named = f"{media!r} is not supported" if media else "the request has no Content-Type"
        raise MediaTypeError(f"{named}; send one of {', '.join(ACCEPTED)}")
    return media


def sniff(data: bytes) -> str:
    """GLB or glTF JSON, by the first bytes: form clients send application/octet-stream.

    Raises MediaTypeError.
    """
    if data.startswith(GLB_MAGIC):
        return GLB
    # A slice: a file of nothing but blanks is not to be copied to find that out.
    if data[:4096].lstrip(b"\xef\xbb\xbf" + BLANK).startswith(b"{"):
        return GLTF
    raise MediaTypeError("the file is neither a GLB nor glTF JSON")
