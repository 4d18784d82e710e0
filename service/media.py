"""Content types: which bodies are taken, and what a file is by its first bytes."""

from __future__ import annotations

from typing import Literal

from service.errors import MediaTypeError

GLB = "model/gltf-binary"
GLTF = "model/gltf+json"
MULTIPART = "multipart/form-data"
ZIP = "application/zip"
ACCEPTED = (GLB, GLTF, ZIP, MULTIPART)

Kind = Literal["glb", "gltf"]
FORMATS: dict[str, Kind] = {GLB: "glb", GLTF: "gltf"}
"""The pipeline's name of each file type."""

GLB_MAGIC = b"glTF"
ZIP_MAGIC = b"PK\x03\x04"
BLANK = b" \t\r\n"


def of_request(content_type: str) -> str:
    """The media type that a Content-Type names, without its parameters. Raises MediaTypeError."""
    media = content_type.partition(";")[0].strip().lower()
    if media not in ACCEPTED:
        named = f"{media!r} is not supported" if media else "the request has no Content-Type"
        raise MediaTypeError(f"{named}; send one of {', '.join(ACCEPTED)}")
    return media


def sniff(data: bytes) -> str:
    """GLB, glTF JSON or an archive, by the first bytes: form clients send application/octet-stream.

    Raises MediaTypeError.
    """
    if data.startswith(GLB_MAGIC):
        return GLB
    if data.startswith(ZIP_MAGIC):
        return ZIP
    # A slice: a file of nothing but blanks is not to be copied to find that out.
    if data[:4096].lstrip(b"\xef\xbb\xbf" + BLANK).startswith(b"{"):
        return GLTF
    raise MediaTypeError("the file is neither a GLB nor glTF JSON, nor a .zip of one")
