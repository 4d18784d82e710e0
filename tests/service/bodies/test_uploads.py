"""Bodies of requests: the files that they hold, and those that are refused."""

import gzip
import io
import zipfile

import pytest

from service.bodies.archive import ArchiveError
from service.bodies.media import GLB, GLTF, ZIP, decoded, encoding_of, sniff
from service.bodies.sibling_files import File
from service.bodies.uploads import MAX_PARTS, MultipartError, sent, sent_files
from service.errors import LimitError, MediaTypeError, UnreadableError
from service.meshfiles.example import part_glb
from service.options import Limits

CONTENT = bytes(range(256)) * 40
WHOLE = gzip.compress(CONTENT)


def test_gzip_is_unpacked_and_without_an_encoding_a_body_is_left_alone():
    for header in ("gzip", "GZIP", " gzip "):
        assert decoded(WHOLE, encoding_of(header), len(CONTENT)) == CONTENT
    for header in ("", "identity", "Identity"):
        assert decoded(CONTENT, encoding_of(header), 1) is CONTENT


@pytest.mark.parametrize("body", [b"", b"no gzip", WHOLE[:-9], WHOLE[:-1] + b"x", WHOLE + b"x"])
def test_what_is_not_one_whole_stream_is_unreadable(body):
    with pytest.raises(UnreadableError):
        decoded(body, "gzip", 10**6)


def test_a_bomb_unpacks_to_its_limit_and_no_further():
    with pytest.raises(LimitError) as refused:
        decoded(gzip.compress(bytes(10**8)), "gzip", 1000)
    assert (refused.value.limit, refused.value.found) == ("body", 1001)


def test_a_file_is_what_its_first_bytes_say():
    for text in (b' \r\n\t{"asset": {}}', b'\xef\xbb\xbf{"asset": {}}'):
        assert sniff(text) == GLTF
    assert (sniff(b"glTF\2\0\0\0"), sniff(b"PK\3\4")) == (GLB, ZIP)
    for unknown in (b"", b"\x89PNG", b"v 0 0 0", b" " * 100_000 + b"{"):
        with pytest.raises(MediaTypeError):
            sniff(unknown)


# Forms

TYPE = "multipart/form-data; boundary=X"
HEAD = b'Content-Disposition: form-data; name="file"; filename="cow.glb"\r\n'


def part(head, content):
    return b"--X\r\n" + head + b"\r\n" + content + b"\r\n"


def other(name, filename, content):
    head = f'Content-Disposition: form-data; name="{name}"; filename="{filename}"\r\n'
    return part(head.encode(), content)


def form(*parts):
    return b"".join(parts) + b"--X--\r\n"


@pytest.mark.parametrize(
    "content", [b"", b"glTF", b"\r\n--Y--\r\n", b"--X", b"\0\r\n\r\n", bytes(range(256)) * 4096]
)
def test_the_content_comes_out_as_it_went_in(content):
    typed = HEAD + b"Content-Type: application/octet-stream\r\n"
    assert sent_files(form(part(typed, content)), TYPE)[0] == File("cow.glb", content)
    # Some clients name no file.
    bare = HEAD.replace(b'; filename="cow.glb"', b"")
    assert sent_files(form(part(bare, content)), TYPE)[0] == File("", content)


LONG = b"A: " + b"b" * 4096 + b"\r\n"
MANY = [other(f"p{number}", "", b"") for number in range(MAX_PARTS)]


@pytest.mark.parametrize(
    ("body", "error", "says"),
    [
        (b"", MultipartError, None),
        (b"no boundary at all", UnreadableError, None),
        (part(HEAD, b"cut off")[:-2], UnreadableError, None),
        (part(HEAD, b"no end"), UnreadableError, None),
        (form(part(HEAD, b"1"), part(HEAD, b"2")), MultipartError, None),
        (form(part(HEAD.replace(b"file", b"mesh"), b"")), MultipartError, None),
        (form(part(b"", b"nameless")), UnreadableError, None),
        (form(part(HEAD.replace(b'file"', b'"'), b"")), MultipartError, None),
        (form(part(HEAD + b"A: " + b"b" * 2**14 + b"\r\n", b"")), UnreadableError, None),
        # Each of these headers is one that the parser takes.
        (form(part(HEAD + 8 * LONG, b"")), UnreadableError, "header"),
        (form(part(HEAD, b"{}"), 2 * other("a", "", b"1")), MultipartError, "'a'"),
        (form(part(HEAD, b""), *MANY), LimitError, "parts"),
    ],
)
def test_a_body_without_one_whole_part_named_file_is_refused(body, error, says):
    with pytest.raises(error, match=says):
        sent_files(body, TYPE)


def test_a_boundary_is_needed():
    with pytest.raises(UnreadableError, match="boundary"):
        sent_files(form(part(HEAD, b"")), "multipart/form-data")


def test_other_parts_are_found_by_their_name_or_a_file_name_that_no_two_share():
    twice = other("c", "x.bin", b"3") + other("d", "x.bin", b"4")
    siblings = sent_files(
        form(
            part(HEAD, b"{}"), other("tex/a.png", "a.png", b"1"), other("b", "b.bin", b"2"), twice
        ),
        TYPE,
    )[1]
    assert siblings.names == {"tex/a.png", "b", "c", "d"}
    found = {"tex/a.png": b"1", "a.png": b"1", "b": b"2", "b.bin": b"2"}
    assert {name: siblings.find(name).content for name in found} == found
    assert siblings.find("e") is siblings.find("x.bin") is None


# Archives


def archive(content):
    """A .zip of one file."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as opened:
        opened.writestr("a.glb", content)
    return made.getvalue()


def encrypted():
    plain = bytearray(archive(part_glb()))
    # The flag stands in the entry's own header and in the index.
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        plain[plain.index(signature) + offset] |= 1
    return bytes(plain)


@pytest.mark.parametrize(
    ("body", "kind", "error", "says"),
    [
        (archive(archive(part_glb())), ZIP, MediaTypeError, "is an archive"),
        (form(part(HEAD, archive(b"")), other("b", "", b"")), TYPE, MediaTypeError, "comes alone"),
        (encrypted(), ZIP, ArchiveError, "encrypted"),
    ],
    ids=["in an archive", "with files beside it", "encrypted"],
)
def test_an_archive_that_is_not_alone_or_open_is_refused(body, kind, error, says):
    with pytest.raises(error, match=says):
        sent(body, kind, Limits())
