"""Bodies of requests: the files that they hold, and those that are refused."""

from __future__ import annotations

import io
import zipfile

import pytest

from service.bodies.archive import ArchiveError
from service.bodies.sibling_files import File
from service.bodies.uploads import MAX_PARTS, MultipartError, sent, sent_files
from service.errors import LimitError, MediaTypeError, ServiceError, UnreadableError
from service.meshfiles.example import part_glb
from service.options import Limits

TYPE = "multipart/form-data; boundary=X"
HEAD = b'Content-Disposition: form-data; name="file"; filename="cow.glb"\r\n'


def part(head: bytes, content: bytes) -> bytes:
    return b"--X\r\n" + head + b"\r\n" + content + b"\r\n"


@pytest.mark.parametrize(
    "content", [b"", b"glTF", b"\r\n--Y--\r\n", b"--X", b"\0\r\n\r\n", bytes(range(256)) * 4096]
)
def test_the_content_comes_out_as_it_went_in(content: bytes) -> None:
    typed = HEAD + b"Content-Type: application/octet-stream\r\n"
    assert sent_files(part(typed, content) + b"--X--\r\n", TYPE)[0] == File("cow.glb", content)
    # Some clients name no file.
    bare = HEAD.replace(b'; filename="cow.glb"', b"")
    assert sent_files(part(bare, content) + b"--X--\r\n", TYPE)[0] == File("", content)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (b"", MultipartError),
        (b"no boundary at all", UnreadableError),
        (part(HEAD, b"cut off")[:-2], UnreadableError),
        (part(HEAD, b"no end"), UnreadableError),
        (part(HEAD, b"1") + part(HEAD, b"2") + b"--X--\r\n", MultipartError),
        (part(HEAD.replace(b"file", b"mesh"), b"") + b"--X--\r\n", MultipartError),
        (part(b"", b"nameless") + b"--X--\r\n", UnreadableError),
        (part(HEAD.replace(b'file"', b'"'), b"") + b"--X--\r\n", MultipartError),
        (part(HEAD + b"A: " + b"b" * 2**14 + b"\r\n", b"") + b"--X--", UnreadableError),
    ],
)
def test_a_body_without_one_whole_part_named_file_is_refused(
    body: bytes, error: type[ServiceError]
) -> None:
    with pytest.raises(error):
        sent_files(body, TYPE)


def test_the_headers_of_a_part_are_short_together_too() -> None:
    """Each of these is one that the parser takes."""
    lines = [b"A: " + b"b" * 4096 + b"\r\n"] * 8
    with pytest.raises(UnreadableError, match="header"):
        sent_files(part(HEAD + b"".join(lines), b"") + b"--X--\r\n", TYPE)


def other(name: str, filename: str, content: bytes) -> bytes:
    head = f'Content-Disposition: form-data; name="{name}"; filename="{filename}"\r\n'
    return part(head.encode(), content)


def test_other_parts_are_found_by_their_name_or_their_file_name() -> None:
    body = part(HEAD, b"{}") + other("tex/a.png", "a.png", b"1") + other("b", "b.bin", b"2")
    siblings = sent_files(body + b"--X--\r\n", TYPE)[1]
    assert siblings.names == {"tex/a.png", "b"}
    for name, content in [("tex/a.png", b"1"), ("a.png", b"1"), ("b", b"2"), ("b.bin", b"2")]:
        sibling = siblings.find(name)
        assert sibling is not None
        assert sibling.content == content
    assert siblings.find("c") is None


def test_a_file_name_that_two_parts_share_names_neither() -> None:
    body = part(HEAD, b"{}") + other("a", "x.bin", b"1") + other("b", "x.bin", b"2")
    siblings = sent_files(body + b"--X--\r\n", TYPE)[1]
    assert siblings.find("x.bin") is None


def test_names_are_distinct_and_parts_are_few() -> None:
    twice = part(HEAD, b"{}") + 2 * other("a", "", b"1")
    with pytest.raises(MultipartError, match="'a'"):
        sent_files(twice + b"--X--\r\n", TYPE)
    many = b"".join(other(f"p{number}", "", b"") for number in range(MAX_PARTS))
    with pytest.raises(LimitError) as refusal:
        sent_files(part(HEAD, b"{}") + many + b"--X--\r\n", TYPE)
    assert refusal.value.limit == "parts"


def test_a_boundary_is_needed() -> None:
    with pytest.raises(UnreadableError, match="boundary"):
        sent_files(part(HEAD, b"") + b"--X--\r\n", "multipart/form-data")


def archive(content: bytes) -> bytes:
    """A .zip of one file."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as opened:
        opened.writestr("a.glb", content)
    return made.getvalue()


def test_an_archive_in_an_archive_is_refused() -> None:
    nested = archive(archive(part_glb()))
    with pytest.raises(MediaTypeError, match="is an archive"):
        sent(nested, "application/zip", Limits())


def test_files_beside_an_archive_are_refused() -> None:
    body = part(HEAD, archive(part_glb())) + other("other", "", b"beside it")
    with pytest.raises(MediaTypeError, match="comes alone"):
        sent(body + b"--X--\r\n", TYPE, Limits())


def test_an_encrypted_archive_is_refused() -> None:
    plain = bytearray(archive(part_glb()))
    # The flag stands in the entry's own header and in the index.
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        plain[plain.index(signature) + offset] |= 1
    with pytest.raises(ArchiveError, match="encrypted"):
        sent(bytes(plain), "application/zip", Limits())
