"""Content-Encoding: what is taken, and how far it may unpack."""

from __future__ import annotations

import gzip

import pytest

from service.bodies.media import decoded, encoding_of
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
