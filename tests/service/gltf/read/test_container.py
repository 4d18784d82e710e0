"""The GLB container and its JSON: exact bounds in, exact bytes out, nothing made uncounted."""

import pytest

from service.errors import LimitError, UnreadableError
from service.gltf.read import container
from service.gltf.read.container import decode_object, encode, read_container, read_glb, write_glb
from service.gltf.read.extensions import accessor_references, unknown_extensions, view_references
from service.options import BYTES_PER_INPUT_BYTE, Limits
from tests.fuzz.seeds import draco, skinned, sparse
from tests.service.gltf.read.refused import refusal
from tests.support.gltf import files
from tests.support.memory import most_of

LIMITS = Limits()
WHOLE = files.pack(b"{}", b"1234")


class Claimed(bytes):
    """Bytes that claim to be 4 GiB long."""

    def __len__(self):
        return 2**32


def test_chunks_are_read_and_written_again():
    data = files.pack(b'{"a":[1,2]}', b"12345", [(b"XTRA", b"more"), (b"LAST", b"")])
    parts = read_glb(data)
    assert (parts.text, bytes(parts.binary)) == (b'{"a":[1,2]} ', b"12345\0\0\0")
    others = [(kind, bytes(content)) for kind, content in parts.others]
    assert others == [(b"XTRA", b"more"), (b"LAST", b"")]
    assert write_glb(parts.text, [parts.binary], parts.others) == data
    # As many as are allowed: JSON and 63 others.
    assert len(read_glb(files.pack(b"{}", others=[(b"XTRA", b"")] * 63)).others) == 63
    with pytest.raises(LimitError, match="bytes"):
        write_glb(b"{}", [Claimed()], [])


def test_first_bytes_say_which_of_both_a_file_is():
    text = b"\xef\xbb\xbf\n {}"
    for kind in ("glb", "gltf"):
        assert read_container(WHOLE, kind).binary == b"1234"
        assert read_container(text, kind).text == text
    # What is neither is looked at as its name says.
    assert read_container(b"[]", "gltf").text == b"[]"


def test_bytes_behind_a_glb_are_counted_and_no_part_of_it():
    assert read_glb(WHOLE).tail == 0
    longer = read_glb(WHOLE + b"\0\n")
    assert (longer.text, bytes(longer.binary), longer.tail) == (b"{}  ", b"1234", 2)
    with pytest.raises(UnreadableError) as refused:
        read_glb(WHOLE[:8] + b"\3\0\0\0" + WHOLE[12:])
    assert "short" not in str(refused.value)


def nested(depth):
    return b"[" * depth + b"]" * depth


DEPTH, PAIRS = LIMITS.max_json_depth, b"[]," * (container._BLOCK // 2)


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        (b'{"a":[' + b"{}," * (8 * 2**20) + b"{}]}", "json-items"),
        (b'{"a":' + b"[" * 100_000, "json-depth"),
        (b'{"a":' * 100_001, "json-depth"),
        (b'{"a":' + nested(DEPTH - 1) + b"}", None),
        (b'{"a":' + nested(DEPTH) + b"}", "json-depth"),
        # Brackets in strings do not nest, and strings go on from block to block.
        (b'{"a":"' + b"[" * 1000 + b'\\"' + b"{" * 1000 + b'\\\\"}', None),
        (b'{"a":[' + 2 * PAIRS + b'"' + PAIRS + b"[" * 1000 + b'"]}', None),
        (b'{"a":[' + PAIRS + nested(DEPTH - 2) + b',"' + PAIRS + b'"]}', None),
        (b'{"a":[' + PAIRS + nested(DEPTH - 1) + b',"' + PAIRS + b'"]}', "json-depth"),
    ],
    ids=range(9),
)
def test_json_is_bounded_before_it_is_decoded(text, limit):
    if limit is None:
        assert decode_object(text, LIMITS)["a"]
        return
    with pytest.raises(LimitError) as refused:
        decode_object(text, LIMITS)
    assert refused.value.limit == limit


def test_a_text_of_brackets_takes_no_more_than_is_predicted_of_it():
    text = b"{" + b"]" * 2**23 + b"}"
    error, used = most_of(refusal, text, "gltf")
    assert error.code == "unreadable"
    assert used < BYTES_PER_INPUT_BYTE * len(text)


def test_values_and_their_order_survive_the_round_trip():
    text = b'{"z":1.0,"a":[1e-7,-0.0,true,null,123456789012345678901,"\xc3\xa9\\u0001"]}'
    value = decode_object(b"\xef\xbb\xbf" + text, LIMITS)
    assert decode_object(encode(value), LIMITS) == value
    assert encode(value) == text


def places(tree):
    references = [*accessor_references(tree), *view_references(tree, tree["accessors"])]
    return [(holder, key) for holders, key in references for holder in holders if key in holder]


@pytest.mark.parametrize("made", [skinned, sparse, draco])
def test_every_place_that_is_renumbered_is_checked(made):
    """One list of them, in effect."""
    count = len(places(made()[0]))
    assert count > 2
    for number in range(count):
        tree, binary = made()
        holder, key = places(tree)[number]
        holder[key] = 10**6
        assert str(10**6) in str(refusal(files.pack(tree, bytes(binary))))


def test_extensions_of_images_textures_nodes_and_attributes_are_known():
    names = ["EXT_mesh_features", "KHR_gaussian_splatting", "KHR_physics_rigid_bodies"]
    names += ["MSFT_texture_dds", "VRMC_materials_hdr_emissiveMultiplier"]
    names += ["VRMC_springBone_extended_collider"]
    assert unknown_extensions({"extensionsUsed": names}, b"") == []
    # To copy the names so far for each of many parts takes most of a minute.
    many = [f"EXT_{number:06d}" for number in range(50_000)]
    tree = {"materials": [{"extensions": {name: {}}} for name in many]}
    assert unknown_extensions(tree, b'"extensions"') == many
