"""Text of many lines, piece by piece: what is found of short lines takes many times their size."""

from __future__ import annotations

import re
from collections.abc import Iterator

# What is looked at in one go.
PIECE = 2**18
# Of OBJ and OFF: it ends with its line, also with a backslash at its end.
COMMENT = re.compile(rb"#[^\n]*")


def without(pattern: re.Pattern[bytes], text: bytes) -> bytes:
    """Return a text without what a pattern matches, which ends no line."""
    pieces = list(pieces_from_end(text))
    return b"".join(pattern.sub(b"", piece) for piece in reversed(pieces))


def pieces_from_end(text: bytes) -> Iterator[bytes]:
    """Yield whole lines, the last ones first: of so many bytes at most, or one that is longer."""
    end = len(text)
    while end:
        # The last letter is a line's end, or there is none: it is no other line's.
        before = text.find(b"\n", end - 1 - PIECE, end - 1) if end > PIECE else -1
        if before < 0 and end > PIECE:
            before = text.rfind(b"\n", 0, end - 1)
        begin = before + 1
        yield text[begin:end]
        end = begin
