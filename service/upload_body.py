"""What a request's body holds: a document, and perhaps files beside it."""

from __future__ import annotations

from dataclasses import dataclass

from service import media
from service.archive import open_archive
from service.errors import MediaTypeError
from service.gltf.neighbours import ALONE, Neighbours
from service.gltf.plan import BYTES_PER_INPUT_BYTE
from service.multipart import sent_files
from service.options import Limits


@dataclass(frozen=True)
class Sent:
    """A document, what it is ("glb" or "gltf"), and its neighbours."""

    data: bytes
    kind: media.Kind
    neighbours: Neighbours = ALONE


def sent(body: bytes, content_type: str, limits: Limits) -> Sent:
    """Unpack a body of any accepted content type.

    Raises:
        ServiceError: the body is not what its content type says, or over a limit.
    """
    media_type = media.of_request(content_type)
    if media_type in media.FORMATS:
        return Sent(body, media.FORMATS[media_type])
    if media_type == media.ZIP:
        return _unpacked(body, limits)
    main, neighbours = sent_files(body, content_type)
    media_type = media.sniff(main)
    if media_type == media.ZIP:
        if neighbours.names:
            raise MediaTypeError("an archive comes alone: the files beside it belong into it")
        return _unpacked(main, limits)
    return Sent(main, media.FORMATS[media_type], neighbours)


def _unpacked(data: bytes, limits: Limits) -> Sent:
    main, neighbours = open_archive(data, limits.max_memory_bytes // BYTES_PER_INPUT_BYTE)
    content = bytes(main.content)
    media_type = media.sniff(content)
    if media_type == media.ZIP:
        raise MediaTypeError("the archive's glTF is an archive")
    return Sent(content, media.FORMATS[media_type], neighbours)
