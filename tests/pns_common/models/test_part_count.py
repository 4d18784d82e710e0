"""Model files of countless parts are refused before anything parses them."""

import pytest

from pns_common import ModelError, load_model
from pns_common.models.part_count import MOST_PARTS, check_part_count


def field(number: int, content: bytes) -> bytes:
    return varint(number << 3 | 2) + varint(len(content)) + content


def varint(value: int) -> bytes:
    groups = []
    while value > 127:
        groups.append(value & 127 | 128)
        value >>= 7
    return bytes([*groups, value])


EMPTY_NODES = field(1, b"") * (MOST_PARTS + 1)
EMPTY_ATTRIBUTES = field(1, field(5, b"") * (MOST_PARTS + 1))


@pytest.mark.parametrize("graph", [EMPTY_NODES, EMPTY_ATTRIBUTES], ids=["nodes", "attributes"])
def test_a_file_of_countless_parts_is_refused(graph, tmp_path):
    path = tmp_path / "many.onnx"
    path.write_bytes(field(7, graph))
    with pytest.raises(ModelError, match=f"at most {MOST_PARTS} parts"):
        load_model(path)


def test_parts_of_graphs_inside_attributes_count_too():
    inner = field(7, field(1, field(5, field(6, EMPTY_NODES))))
    with pytest.raises(ModelError):
        check_part_count(inner, "nested")


def test_a_file_over_the_limit_of_bytes_is_not_read(tmp_path):
    path = tmp_path / "large.onnx"
    with path.open("wb") as file:
        file.truncate(60_000_000)
    with pytest.raises(ModelError, match="bytes"):
        load_model(path)


@pytest.mark.parametrize("data", [b"", b"\xff" * 40, b"\x3a\xff\xff\xff\xff\x0f", b"no model"])
def test_what_is_no_protocol_buffer_is_left_to_the_parser(data):
    check_part_count(data, "broken")
