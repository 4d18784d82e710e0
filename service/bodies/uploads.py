"""Read a request's body: a document, and perhaps files beside it."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import MediaTypeError
from ..options import BYTES_PER_INPUT_BYTE, Limits
from . import media
from .archive import open_archive
from .multipart import sent_files
from .sibling_files import ALONE, SiblingFiles


@dataclass(frozen=True)
class Sent:
    """A document, what it is ("glb", "gltf", "obj", …), and its siblings."""

    data: bytes
    kind: media.Kind
    siblings: SiblingFiles = ALONE


def sent(body: bytes, content_type: str, limits: Limits) -> Sent:
    """Unpack a body of any accepted content type.

    Raises:
        ServiceError: the body is not what its content type says, or over a limit.
    """
    media_type = media.of_request(content_type)
    if media_type in media.FORMATS:
        return Sent(body, media.FORMATS[media_type])
    if media_type == media.BYTES:
        media_type = media.sniff(body)
        if media_type != media.ZIP:
            return Sent(body, media.FORMATS[media_type])
    if media_type == media.ZIP:
        return _unpacked(body, limits)
    files = sent_files(body, content_type)
    content = bytes(files.main.content)
    kind = media.mesh_kind_of(files.main.name)
    if kind is not None:
        return Sent(content, kind, files.siblings)
    media_type = media.sniff(content)
    if media_type == media.ZIP:
        if files.siblings.names:
            raise MediaTypeError("an archive comes alone: the files beside it belong into it")
        return _unpacked(content, limits)
    return Sent(content, media.FORMATS[media_type], files.siblings)


def _unpacked(data: bytes, limits: Limits) -> Sent:
    main, siblings = open_archive(data, limits.max_memory_bytes // BYTES_PER_INPUT_BYTE)
    content = bytes(main.content)
    media_type = media.sniff(content)
    if media_type == media.ZIP:
        raise MediaTypeError("the archive's glTF is an archive")
    return Sent(content, media.FORMATS[media_type], siblings)
