"""Strict JSON, bounded before it is decoded."""

import tracemalloc

import pytest

from service.errors import GltfError, LimitError, UnreadableError
from service.gltf.read import container
from service.gltf.read.container import decode_object, encode
from service.options import BYTES_PER_INPUT_BYTE, Limits

LIMITS = Limits()


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"{",
        b'{"a":NaN}',
        b'{"a":Infinity}',
        b'{"a":1e999}',
        b"{'a':1}",
        b'{"a":1,}',
        b'{"a":1} {}',
        b'{"a":"\xff"}',
        b'{"a":"\xed\xa0\x80"}',
        b'{"a":"\\ud800"}',
        b'{"a":01}',
    ],
)
def test_what_is_not_json_is_unreadable(text):
    with pytest.raises(UnreadableError):
        decode_object(text, LIMITS)


@pytest.mark.parametrize("text", [b"[]", b"1", b'"glTF"', b"null"])
def test_another_top_level_than_an_object_is_refused(text):
    with pytest.raises(GltfError):
        decode_object(text, LIMITS)


def test_millions_of_empty_objects_are_refused_undecoded():
    text = b'{"a":[' + b"{}," * (8 * 2**20) + b"{}]}"
    with pytest.raises(LimitError) as refusal:
        decode_object(text, LIMITS)
    assert refusal.value.limit == "json-items"
    assert refusal.value.found > LIMITS.max_json_items


@pytest.mark.parametrize("opening", [b"[", b'{"a":'])
def test_deep_nesting_is_refused_undecoded(opening):
    with pytest.raises(LimitError) as refusal:
        decode_object(b'{"a":' + opening * 100_000, LIMITS)
    assert refusal.value.limit == "json-depth"


def test_depth_is_allowed_up_to_the_limit():
    depth = LIMITS.max_json_depth - 1
    assert decode_object(b'{"a":' + b"[" * depth + b"]" * depth + b"}", LIMITS)
    with pytest.raises(LimitError):
        decode_object(b'{"a":' + b"[" * (depth + 1) + b"]" * (depth + 1) + b"}", LIMITS)


def test_brackets_in_strings_do_not_nest():
    text = b'{"a":"' + b"[" * 1000 + b'\\"' + b"{" * 1000 + b'\\\\"}'
    assert decode_object(text, LIMITS) == {"a": "[" * 1000 + '"' + "{" * 1000 + "\\"}


def test_depth_and_strings_go_on_from_block_to_block():
    depth = LIMITS.max_json_depth - 2
    pairs = b"[]," * (container._BLOCK // 2)
    text = b'{"a":[%s"' + pairs + b"[" * 1000 + b'"]}'
    assert decode_object(text.replace(b"%s", pairs), LIMITS)
    assert decode_object(text.replace(b"%s", pairs + nested(depth) + b","), LIMITS)
    with pytest.raises(LimitError):
        decode_object(text.replace(b"%s", pairs + nested(depth + 1) + b","), LIMITS)


def nested(depth):
    return b"[" * depth + b"]" * depth


def test_a_text_of_brackets_takes_no_more_than_is_predicted_of_it():
    text = b"{" + b"]" * 2**23 + b"}"
    tracemalloc.start()
    try:
        with pytest.raises(UnreadableError):
            decode_object(text, LIMITS)
        assert tracemalloc.get_traced_memory()[1] < BYTES_PER_INPUT_BYTE * len(text)
    finally:
        tracemalloc.stop()


def test_a_byte_order_mark_is_passed_over():
    assert decode_object(b'\xef\xbb\xbf{"a":1}', LIMITS) == {"a": 1}


@pytest.mark.parametrize("digits", [310, 4300, 5000])
@pytest.mark.parametrize("sign", ["", "-"])
def test_an_integer_without_end_is_refused_by_its_pointer(digits, sign):
    text = f'{{"a":{{"b/c":[1,{sign}{"9" * digits}]}}}}'.encode()
    with pytest.raises(GltfError) as refusal:
        decode_object(text, LIMITS)
    assert refusal.value.pointer == "/a/b~1c/1"


def test_values_and_their_order_survive_the_round_trip():
    text = b'{"z":1.0,"a":[1e-7,-0.0,true,null,123456789012345678901,"\xc3\xa9\\u0001"]}'
    value = decode_object(text, LIMITS)
    assert decode_object(encode(value), LIMITS) == value
    assert encode(value) == text
