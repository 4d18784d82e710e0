"""The one file of a multipart body, unpacked in a worker once all of the body is there."""

from __future__ import annotations

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from service.errors import ServiceError, UnreadableError

# A part has three or four short headers; a megabyte of them is an attack.
MAX_HEADER_BYTES = 16 * 1024


class MultipartError(ServiceError):
    """A multipart body that reads, but is not one part with the name `file`."""

    status = 422
    code = "invalid-multipart"
    title = "The multipart body must have one part, named file"


class _OnePart:
    """Collects the only part that is allowed; a second one, or another name, is an error."""

    def __init__(self) -> None:
        self.parts = 0
        self.finished = False
        self.headers: dict[bytes, bytes] = {}
        self.data = bytearray()
        self._field = bytearray()
        self._value = bytearray()
        self._header_bytes = 0

    def callbacks(self) -> dict[str, object]:
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
        self.parts += 1
        if self.parts > 1:
            raise MultipartError("the body has more than one part")

    def _header(self, target: bytearray, piece: bytes) -> None:
        self._header_bytes += len(piece)
        if self._header_bytes > MAX_HEADER_BYTES:
            raise UnreadableError("the part's headers are too long")
        target += piece

    def _header_end(self) -> None:
        self.headers[bytes(self._field).lower()] = bytes(self._value)
        self._field.clear()
        self._value.clear()

    def _headers_finished(self) -> None:
        _, options = parse_options_header(self.headers.get(b"content-disposition", b""))
        if options.get(b"name") != b"file":
            raise MultipartError("the part's name is not file")

    def _part_data(self, data: bytes, start: int, end: int) -> None:
        self.data += memoryview(data)[start:end]

    def _end(self) -> None:
        self.finished = True


def only_file(body: bytes, content_type: str) -> bytes:
    """The content of the one part named `file`.

    Raises UnreadableError where the body is no multipart body, MultipartError where it holds
    something else.
    """
    boundary = parse_options_header(content_type)[1].get(b"boundary")
    if not boundary:
        raise UnreadableError("the Content-Type names no multipart boundary")
    part = _OnePart()
    try:
        parser = MultipartParser(boundary, part.callbacks())
        parser.write(body)
        parser.finalize()
    except FormParserError as error:
        raise UnreadableError(f"the multipart body cannot be read: {error}") from error
    if part.parts == 0:
        raise MultipartError("the body has no part")
    if not part.finished:
        raise UnreadableError("the multipart body ends before its closing boundary")
    return bytes(part.data)
