"""The GLB container: exact bounds in, exact bytes out."""

import struct

import pytest

from service.errors import LimitError, UnreadableError
from service.gltf.read.container import read_container, read_glb, write_glb
from tests.support.gltf import files


class Claimed(bytes):
    """Bytes that claim to be 4 GiB long."""

    def __len__(self):
        return 2**32


def test_chunks_are_read_and_written_again():
    data = files.pack(b'{"a":[1,2]}', b"12345", [(b"XTRA", b"more"), (b"LAST", b"")])
    container = read_glb(data)
    assert container.text == b'{"a":[1,2]} '
    assert bytes(container.binary) == b"12345\0\0\0"
    assert [(kind, bytes(content)) for kind, content in container.others] == [
        (b"XTRA", b"more"),
        (b"LAST", b""),
    ]
    assert write_glb(container.text, [container.binary], container.others) == data


def test_chunks_are_counted_before_they_are_made():
    data = files.pack(b"{}", others=[(b"XTRA", b"")] * 1000)
    with pytest.raises(LimitError) as refusal:
        read_glb(data)
    assert refusal.value.limit == "glb-chunks"
    # As many as are allowed: JSON and 63 others.
    assert len(read_glb(files.pack(b"{}", others=[(b"XTRA", b"")] * 63)).others) == 63


def test_first_bytes_say_which_of_both_a_file_is():
    binary, text = files.pack(b"{}", b"1234"), b"\xef\xbb\xbf\n {}"
    for kind in ("glb", "gltf"):
        assert read_container(binary, kind).binary == b"1234"
        assert read_container(text, kind).text == text
    # What is neither is looked at as its name says.
    assert read_container(b"[]", "gltf").text == b"[]"
    for start, said in (
        (b"a text", "'a text t'"),
        (b"solid\r\na", "'solid a'"),
        (b"\n" * 8, "0a 0a"),
        (b"PK\x03\x04", "50 4b 03 04"),
    ):
        with pytest.raises(UnreadableError, match=f"not a glTF file: it begins with {said}"):
            read_container(start + b" that is no GLB", "glb")


WHOLE = files.pack(b"{}", b"1234")
BROKEN = {
    "empty": b"",
    "shorter than its header": WHOLE[:11],
    "another magic": b"gltf" + WHOLE[4:],
    "another version": WHOLE[:4] + struct.pack("<I", 1) + WHOLE[8:],
    "shorter than it says": WHOLE[:-1],
    "no chunk": struct.pack("<4sII", b"glTF", 2, 12),
    "half a chunk header": struct.pack("<4sII", b"glTF", 2, 16) + b"1234",
    "a chunk beyond the end": struct.pack("<4sIII4s", b"glTF", 2, 20, 2**32 - 1, b"JSON"),
    "BIN before JSON": struct.pack("<4sII", b"glTF", 2, 20) + files.chunk(b"BIN\0", b"", b""),
}


def test_bytes_behind_a_glb_are_counted_and_no_part_of_it():
    assert read_glb(WHOLE).tail == 0
    longer = read_glb(WHOLE + b"\0\n")
    assert (longer.text, bytes(longer.binary), longer.tail) == (b"{}  ", b"1234", 2)


@pytest.mark.parametrize("kind", BROKEN)
def test_wrong_bounds_are_unreadable(kind):
    with pytest.raises(UnreadableError):
        read_glb(BROKEN[kind])


def test_a_file_that_was_cut_short_says_so():
    with pytest.raises(UnreadableError, match="the file is cut short"):
        read_glb(WHOLE[:-1])
    with pytest.raises(UnreadableError) as refusal:
        read_glb(WHOLE[:8] + struct.pack("<I", 3) + WHOLE[12:])
    assert "short" not in str(refusal.value)


def test_what_a_container_cannot_hold_is_refused_before_it_is_joined():
    with pytest.raises(LimitError, match="bytes"):
        write_glb(b"{}", [Claimed()], [])
