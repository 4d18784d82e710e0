"""Read a body, in a worker: a document, and perhaps files beside it, in parts or an archive."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from python_multipart import FormParser
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import Field, parse_options_header
from python_multipart.multipart import File as SentFile

from ..errors import MediaTypeError, ServiceError, UnreadableError, check_limit
from ..options import BYTES_PER_INPUT_BYTE, Limits
from . import media
from .archive import open_archive
from .sibling_files import ALONE, File, SiblingFiles, relative_name

MAX_PARTS = 256
MAIN = "file"


class MultipartError(ServiceError):
    """A multipart body that reads, but is not one part with the name `file` and files beside it."""

    status = 422
    code = "invalid-multipart"
    title = "The multipart body must have one part named file, and others with names of their own"


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
    data, kind, siblings = body, media.FORMATS.get(media_type), ALONE
    if media_type == media.MULTIPART:
        main, siblings = sent_files(body, content_type)
        data, named = bytes(main.content), media.kind_of(main.name)
        # A glTF is told by its first bytes.
        kind = None if named in media.GLTF_KINDS else named
    if kind is not None:
        return Sent(data, kind, siblings)
    if media_type != media.ZIP:
        media_type = media.sniff(data)
    if media_type == media.ZIP:
        if siblings.names:
            raise MediaTypeError("an archive comes alone: the files beside it belong into it")
        main, siblings = open_archive(data, limits.max_memory_bytes // BYTES_PER_INPUT_BYTE)
        data = bytes(main.content)
        media_type = media.sniff(data)
        if media_type == media.ZIP:
            raise MediaTypeError("the archive's glTF is an archive")
    return Sent(data, media.FORMATS[media_type], siblings)


@dataclass(frozen=True)
class _Part:
    name: str
    filename: str
    content: bytes


def sent_files(body: bytes, content_type: str) -> tuple[File, SiblingFiles]:
    """Return the one part named `file`, called as its sender's file is, and those beside it.

    A neighbour is called by its part's name, or else by its file name: form clients strip folders
    from the latter.

    Raises:
        UnreadableError: no multipart body.
        MultipartError: none or several parts named `file`, or others that share a name.
        LimitError: too many parts.
    """
    parts = _parsed(body, content_type)
    main = [part for part in parts if part.name == MAIN]
    if len(main) != 1:
        raise MultipartError(f"{len(main)} parts have the name {MAIN}, not one")
    siblings = _siblings(part for part in parts if part.name != MAIN)
    return File(main[0].filename, main[0].content), siblings


def _parsed(body: bytes, content_type: str) -> list[_Part]:
    boundary = parse_options_header(content_type)[1].get(b"boundary")
    if not boundary:
        raise UnreadableError("the Content-Type names no multipart boundary")
    parts: list[_Part] = []
    ends: list[bool] = []

    def take(sent: Field | SentFile) -> None:
        count = len(parts) + 1
        check_limit("parts", count, MAX_PARTS, f"the body has {count} parts or more")
        name = (sent.field_name or b"").decode(errors="replace")
        if not name:
            raise MultipartError("a part has no name")
        if isinstance(sent, Field):
            parts.append(_Part(name, "", sent.value or b""))
        else:
            filename = (sent.file_name or b"").decode(errors="replace")
            sent.file_object.seek(0)
            parts.append(_Part(name, filename, sent.file_object.read()))

    try:
        # Its own limits bound the headers of a part.
        parser = FormParser(
            "multipart/form-data",
            on_field=take,
            on_file=take,
            on_end=lambda: ends.append(True),
            boundary=boundary,
            config={"MAX_MEMORY_FILE_SIZE": float("inf")},
        )
        parser.write(body)
        parser.finalize()
    except FormParserError as error:
        raise UnreadableError(f"the multipart body cannot be read: {error}") from error
    if body and not ends:
        raise UnreadableError("the multipart body ends before its closing boundary")
    return parts


def _siblings(parts: Iterable[_Part]) -> SiblingFiles:
    by_name: dict[str, File] = {}
    by_filename: defaultdict[str, list[File]] = defaultdict(list)
    for part in parts:
        if part.name in by_name:
            raise MultipartError(f"two parts have the name {part.name!r}")
        file = by_name[part.name] = File(part.name, part.content)
        by_filename[relative_name(part.filename) or ""].append(file)
    names = {relative_name(name) or "": file for name, file in by_name.items()}

    def find(name: str) -> File | None:
        if name in names:
            return names[name]
        # A file name that two parts share is no name.
        of_that_name = by_filename.get(name, [])
        return of_that_name[0] if len(of_that_name) == 1 else None

    return SiblingFiles(find, frozenset(by_name))
