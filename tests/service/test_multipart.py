"""The one part of a multipart body, whatever a client makes of it."""

from __future__ import annotations

import pytest

from service.errors import MediaTypeError, ServiceError, UnreadableError
from service.media import GLB, GLTF, sniff
from service.multipart import MAX_HEADER_BYTES, MultipartError, only_file

TYPE = "multipart/form-data; boundary=X"
HEAD = b'Content-Disposition: form-data; name="file"; filename="cow.glb"\r\n'


def part(head: bytes, content: bytes) -> bytes:
    return b"--X\r\n" + head + b"\r\n" + content + b"\r\n"


@pytest.mark.parametrize(
    "content", [b"", b"glTF", b"\r\n--Y--\r\n", b"--X", b"\0\r\n\r\n", bytes(range(256)) * 4096]
)
def test_the_content_comes_out_as_it_went_in(content: bytes) -> None:
    typed = HEAD + b"Content-Type: application/octet-stream\r\n"
    assert only_file(part(typed, content) + b"--X--\r\n", TYPE) == content


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (b"", MultipartError),
        (b"no boundary at all", UnreadableError),
        (part(HEAD, b"cut off")[:-2], UnreadableError),
        (part(HEAD, b"no end"), UnreadableError),
        (part(HEAD, b"1") + part(HEAD, b"2") + b"--X--\r\n", MultipartError),
        (part(HEAD.replace(b"file", b"mesh"), b"") + b"--X--\r\n", MultipartError),
        (part(b"", b"nameless") + b"--X--\r\n", MultipartError),
        (part(HEAD + b"A: " + b"b" * MAX_HEADER_BYTES + b"\r\n", b"") + b"--X--", UnreadableError),
    ],
)
def test_anything_but_one_whole_part_named_file_is_refused(
    body: bytes, error: type[ServiceError]
) -> None:
    with pytest.raises(error):
        only_file(body, TYPE)


def test_a_boundary_is_needed() -> None:
    with pytest.raises(UnreadableError, match="boundary"):
        only_file(part(HEAD, b"") + b"--X--\r\n", "multipart/form-data")


def test_a_file_is_what_its_first_bytes_say() -> None:
    assert sniff(b"glTF\2\0\0\0") == GLB
    assert sniff(b' \r\n\t{"asset": {}}') == GLTF
    assert sniff(b'\xef\xbb\xbf{"asset": {}}') == GLTF
    for other in (b"", b"\x89PNG", b"v 0 0 0", b" " * 100_000 + b"{"):
        with pytest.raises(MediaTypeError):
            sniff(other)
