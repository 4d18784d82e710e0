"""The files of a multipart body, unpacked in a worker once all of the body is there."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from ..errors import ServiceError, UnreadableError, check_limit
from .sibling_files import File, SiblingFiles, relative_name

# A part has three or four short headers; a megabyte of them is an attack.
MAX_HEADER_BYTES = 16 * 1024
MAX_PARTS = 256
MAIN = "file"


class MultipartError(ServiceError):
    """A multipart body that reads, but is not one part with the name `file` and files beside it."""

    status = 422
    code = "invalid-multipart"
    title = "The multipart body must have one part named file, and others with names of their own"


@dataclass
class _Part:
    headers: dict[bytes, bytes] = field(default_factory=dict)
    data: bytearray = field(default_factory=bytearray)
    name: str = ""
    filename: str = ""


class _Parts:
    """Collects the parts."""

    def __init__(self) -> None:
        self.parts: list[_Part] = []
        self.finished = False
        self._field = bytearray()
        self._value = bytearray()
        self._header_bytes = 0

    def callbacks(self) -> Any:
        return {
            "on_part_begin": self._part_begin,
            "on_header_field": lambda data, start, end: self._header(self._field, data[start:end]),
            "on_header_value": lambda data, start, end: self._header(self._value, data[start:end]),
            "on_header_end": self._header_end,
            "on_headers_finished": self._headers_finished,
            "on_part_data": self._part_data,
            "on_end": self._end,
        }

    def _part_begin(self) -> None:
        count = len(self.parts) + 1
        check_limit("parts", count, MAX_PARTS, f"the body has {count} parts or more")
        self.parts.append(_Part())
        self._header_bytes = 0

    def _header(self, target: bytearray, piece: bytes) -> None:
        self._header_bytes += len(piece)
        if self._header_bytes > MAX_HEADER_BYTES:
            raise UnreadableError("the part's headers are too long")
        target += piece

    def _header_end(self) -> None:
        self.parts[-1].headers[bytes(self._field).lower()] = bytes(self._value)
        self._field.clear()
        self._value.clear()

    def _headers_finished(self) -> None:
        part = self.parts[-1]
        _, options = parse_options_header(part.headers.get(b"content-disposition", b""))
        part.name, part.filename = (
            options.get(key, b"").decode(errors="replace") for key in (b"name", b"filename")
        )
        if not part.name:
            raise MultipartError("a part has no name")

    def _part_data(self, data: bytes, start: int, end: int) -> None:
        self.parts[-1].data += memoryview(data)[start:end]

    def _end(self) -> None:
        self.finished = True


@dataclass(frozen=True)
class SentFiles:
    """The one part named `file`, called as its sender's file is, and the other parts beside it."""

    main: File
    siblings: SiblingFiles


def sent_files(body: bytes, content_type: str) -> SentFiles:
    """Return the files of a form.

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
    others = [part for part in parts if part.name != MAIN]
    return SentFiles(File(main[0].filename, bytes(main[0].data)), _siblings(others))


def _parsed(body: bytes, content_type: str) -> list[_Part]:
    boundary = parse_options_header(content_type)[1].get(b"boundary")
    if not boundary:
        raise UnreadableError("the Content-Type names no multipart boundary")
    collected = _Parts()
    try:
        parser = MultipartParser(boundary, collected.callbacks())
        parser.write(body)
        parser.finalize()
    except FormParserError as error:
        raise UnreadableError(f"the multipart body cannot be read: {error}") from error
    if collected.parts and not collected.finished:
        raise UnreadableError("the multipart body ends before its closing boundary")
    return collected.parts


def _siblings(parts: list[_Part]) -> SiblingFiles:
    by_name: dict[str, File] = {}
    by_filename: defaultdict[str, list[File]] = defaultdict(list)
    for part in parts:
        file = File(part.name, bytes(part.data))
        if part.name in by_name:
            raise MultipartError(f"two parts have the name {part.name!r}")
        by_name[part.name] = file
        by_filename[relative_name(part.filename) or ""].append(file)
    names = {relative_name(name) or "": file for name, file in by_name.items()}

    def find(name: str) -> File | None:
        if name in names:
            return names[name]
        # A file name that two parts share is no name.
        of_that_name = by_filename.get(name, [])
        return of_that_name[0] if len(of_that_name) == 1 else None

    return SiblingFiles(find, frozenset(by_name))
