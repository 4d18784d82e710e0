"""The kinds of files that are taken: media types, first bytes, and how bodies are encoded."""

from __future__ import annotations

import re
import zlib
from typing import Literal, get_args

from ..errors import MediaTypeError, UnreadableError, check_limit

GLB = "model/gltf-binary"
GLTF = "model/gltf+json"
JSON = "application/json"
MULTIPART = "multipart/form-data"
MIXED = "multipart/mixed"
ZIP = "application/zip"

# As their names end.
Kind = Literal["glb", "gltf", "obj", "ply", "stl", "off", "3mf"]
KINDS: tuple[Kind, ...] = get_args(Kind)
GLTF_KINDS = ("glb", "gltf")
# Other endings of the same kinds: a VRM is a GLB.
ALIASES: dict[str, Kind] = {"vrm": "glb"}
# The pipeline's name of each file type. OBJ's, STL's and 3MF's beside glTF's are registered.
FORMATS: dict[str, Kind] = {
    GLB: "glb",
    GLTF: "gltf",
    "model/obj": "obj",
    "model/ply": "ply",
    "model/stl": "stl",
    "model/off": "off",
    "model/3mf": "3mf",
}
MEDIA_TYPES: dict[Kind, str] = {kind: media for media, kind in FORMATS.items()}
# Any glTF, or an archive of one, told by its first bytes: generated clients send no other type.
BYTES = "application/octet-stream"
ACCEPTED = (*FORMATS, ZIP, MULTIPART, BYTES)

_WEIGHT = re.compile(r"q\s*=\s*(0(?:\.\d{0,3})?|1(?:\.0{0,3})?)")

GLB_MAGIC = b"glTF"
ZIP_MAGIC = b"PK\x03\x04"
IDENTITY, GZIP = "identity", "gzip"
# zlib's number for a gzip header and its checksum.
_GZIP_BITS = 31


def is_apple_double(path: str) -> bool:
    """Return whether a file holds what macOS keeps of another, whose name it has behind `._`."""
    return path.rpartition("/")[2].startswith("._")


def of_request(content_type: str) -> str:
    """Return the media type of a Content-Type, without its parameters. Raises MediaTypeError."""
    media = content_type.partition(";")[0].strip().lower()
    if media not in ACCEPTED:
        named = f"{media!r} is not supported" if media else "the request has no Content-Type"
        raise MediaTypeError(f"{named}; send one of {', '.join(ACCEPTED)}")
    return media


def quality(media: str, accept: str) -> float:
    """Return how much an Accept header wants a media type, 0 to 1: by its most specific range.

    A coding in Accept-Encoding reads as one.
    """
    ranges = (media, f"{media.partition('/')[0]}/*", "*/*")
    wanted: dict[str, float] = {}
    for entry in accept.lower().split(","):
        pattern, *parameters = entry.split(";")
        # Of many thousands in a head hardly any is one of these.
        if (pattern := pattern.strip()) in ranges:
            weights = (_WEIGHT.fullmatch(parameter.strip()) for parameter in parameters)
            wanted[pattern] = next((float(weight[1]) for weight in weights if weight), 1.0)
    return next((wanted[pattern] for pattern in ranges if pattern in wanted), 0.0)


def sniff(data: bytes) -> str:
    """Tell GLB, glTF JSON or an archive by the first bytes: form clients send octet streams.

    Raises MediaTypeError.
    """
    if data.startswith(GLB_MAGIC):
        return GLB
    if data.startswith(ZIP_MAGIC):
        return ZIP
    if begins_as_json(data):
        return GLTF
    raise MediaTypeError("the file is neither a GLB nor glTF JSON, nor a .zip of one")


def begins_as_json(data: bytes) -> bool:
    """Return whether a file begins as a JSON object does."""
    # A slice: a file of nothing but blanks is not to be copied to find that out.
    return data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{")


def kind_of(name: str) -> Kind | None:
    """Return the kind of a file by its name's ending; None where it is of none."""
    ending = name.rpartition("/")[2].rpartition(".")[2].lower()
    kinds: dict[str, Kind] = {kind: kind for kind in KINDS}
    return (kinds | ALIASES).get(ending)


def encoding_of(header: str) -> str:
    """Return the encoding that a Content-Encoding header names. Raises MediaTypeError."""
    encoding = header.strip().lower() or IDENTITY
    if encoding not in (IDENTITY, GZIP):
        raise MediaTypeError(f"Content-Encoding {encoding!r} is not supported; send {GZIP} or none")
    return encoding


def decoded(body: bytes, encoding: str, max_bytes: int) -> bytes:
    """Return a body as it was before its encoding.

    Raises:
        LimitError: it has more than `max_bytes`.
        UnreadableError: it is not gzip, ends too early, or something follows it.
    """
    if encoding == IDENTITY:
        return body
    stream = zlib.decompressobj(_GZIP_BITS)
    try:
        content = stream.decompress(body, max_bytes + 1)
    except zlib.error as error:
        raise UnreadableError(f"the body is not {GZIP}: {error}") from error
    text = f"the body unpacks to {len(content)} bytes or more"
    check_limit("body", len(content), max_bytes, text)
    if not stream.eof:
        raise UnreadableError(f"the body ends before its {GZIP} stream")
    if stream.unused_data:
        raise UnreadableError(f"{len(stream.unused_data)} bytes follow the {GZIP} stream")
    return content
