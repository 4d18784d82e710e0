"""Media: what first bytes and headers say of a body, and how far an encoding may unpack."""

from __future__ import annotations

import gzip

import pytest

from service.bodies.media import GLB, GLTF, ZIP, decoded, encoding_of, quality, sniff
from service.errors import LimitError, MediaTypeError, UnreadableError

CONTENT = bytes(range(256)) * 40
WHOLE = gzip.compress(CONTENT)


@pytest.mark.parametrize("header", ["gzip", "GZIP", " gzip "])
def test_gzip_is_taken_and_unpacked(header: str) -> None:
    assert decoded(WHOLE, encoding_of(header), len(CONTENT)) == CONTENT


@pytest.mark.parametrize("header", ["", "identity", "Identity"])
def test_no_encoding_leaves_the_body_alone(header: str) -> None:
    assert decoded(CONTENT, encoding_of(header), 1) is CONTENT


@pytest.mark.parametrize("header", ["br", "deflate", "gzip, gzip", "x"])
def test_another_encoding_is_refused(header: str) -> None:
    with pytest.raises(MediaTypeError):
        encoding_of(header)


def test_a_bomb_unpacks_to_its_limit_and_no_further() -> None:
    with pytest.raises(LimitError) as refused:
        decoded(gzip.compress(bytes(10**8)), "gzip", 1000)
    assert (refused.value.limit, refused.value.found) == ("body", 1001)


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"no gzip",
        gzip.compress(CONTENT)[:-9],
        gzip.compress(CONTENT)[:-1] + b"x",
        gzip.compress(CONTENT) + b"x",
    ],
)
def test_what_is_not_one_whole_stream_is_unreadable(body: bytes) -> None:
    with pytest.raises(UnreadableError):
        decoded(body, "gzip", 10**6)


@pytest.mark.parametrize(
    ("accept", "wanted"),
    [
        ("", 0.0),
        ("application/json", 1.0),
        (" Application/JSON ; Q = 0.5 ", 0.5),
        ("*/*;q=0.1, application/*;q=0.2", 0.2),
        ("application/*, application/json;q=0", 0.0),
        ("application/json;v=1;q=0.3;q=0.4", 0.3),
        ("application/json;q=2", 1.0),
        ("application/json;q=0.5, application/json", 1.0),
        ("text/*, , application/jsonp", 0.0),
    ],
)
def test_the_most_specific_range_tells(accept: str, wanted: float) -> None:
    assert quality("application/json", accept) == wanted


def test_a_file_is_what_its_first_bytes_say() -> None:
    assert sniff(b"glTF\2\0\0\0") == GLB
    assert sniff(b' \r\n\t{"asset": {}}') == GLTF
    assert sniff(b'\xef\xbb\xbf{"asset": {}}') == GLTF
    assert sniff(b"PK\3\4") == ZIP
    for unknown in (b"", b"\x89PNG", b"v 0 0 0", b" " * 100_000 + b"{"):
        with pytest.raises(MediaTypeError):
            sniff(unknown)
