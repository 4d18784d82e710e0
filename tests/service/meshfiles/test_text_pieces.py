"""Text in pieces of whole lines, for what would take many times its size."""

import re
import tracemalloc

import pytest

from service.meshfiles import text_pieces
from service.meshfiles.text_pieces import without

GROUPS = re.compile(rb"^g[^\n]*$", re.MULTILINE)


@pytest.mark.parametrize(
    "text", [b"", b"g", b"\n", b"g a\nv 1\n\ng\nf 1 2 3\ng b", b"g " + 50 * b"x"]
)
@pytest.mark.parametrize("size", [1, 5, 8, 100])
def test_lines_are_taken_out_as_of_the_whole_text(text, size, monkeypatch):
    monkeypatch.setattr(text_pieces, "PIECE", size)
    assert without(GROUPS, text) == GROUPS.sub(b"", text)


def test_short_lines_take_no_multiple_of_their_text(monkeypatch):
    monkeypatch.setattr(text_pieces, "PIECE", 2**10)
    text = 100_000 * b"g a\n"
    tracemalloc.start()
    try:
        assert without(GROUPS, text) == 100_000 * b"\n"
        assert tracemalloc.get_traced_memory()[1] < 2 * len(text)
    finally:
        tracemalloc.stop()
