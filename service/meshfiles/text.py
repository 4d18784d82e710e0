"""Text files: line ends and encodings as they occur, and numbers read in bulk, with their lines."""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, Shaped, UInt8

from pns_common.kernels import text as kernels

from ..errors import UnreadableError

# How text formats write a coordinate: micrometres are kept in coordinates of kilometres.
NUMBER = "%.12g"
# Rows of text that are made at a time.
BLOCK = 2**14
POWERS, WHOLES = 10.0 ** np.arange(23), 10 ** np.arange(17)
_DIGITS = {"%.7g": 7, NUMBER: 12}
_PLACE = re.compile(r"%[#.\d]*[dg]")
_BLANK, _LINE_END, _COMMENT, _BACKSLASH = b" \n#\\"
_BEHIND_NAME = re.compile(rb"\s#(?:\s.*)?$", re.DOTALL)
# How Microsoft's old libraries write infinity and NaN.
_NO_NUMBER = re.compile(rb"\d\.#(?:(INF)|IND|[QS]NAN)\w*")
# What a joined line has in place of its end, which still counts as one.
_JOINED = b" \x0b"
_NUMBER = re.compile(
    rb"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan(?:\(\w*\))?|inf(?:inity)?)", re.I
)
_WIDE = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def plain_text(data: bytes) -> bytes:
    """Return a text as bytes of one letter each: no byte-order mark, and lines end with \\n."""
    encoding = next((name for mark, name in _WIDE if data.startswith(mark)), None)
    if encoding is None and len(data) > 1 and 0 in data[:2]:
        encoding = "utf-16-le" if data[0] else "utf-16-be"
    if encoding == "utf-8":
        data = data[len(codecs.BOM_UTF8) :]
    elif encoding is not None:
        data = data.decode(encoding, errors="replace").encode()
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b".#" in data:
        data = _NO_NUMBER.sub(lambda found: b"inf" if found[1] else b"nan", data)
    return data


def name_of(text: bytes) -> str:
    """Return a name without the comment behind it; those of old files are Latin-1."""
    name = named(text)
    return name.decode(encoding_of(name))


def named(text: bytes) -> bytes:
    """Return a name without the comment behind it.

    A # within a word, or before one as in `Material #2`, begins no comment.
    """
    return _BEHIND_NAME.sub(b"", text).strip()


def encoding_of(text: bytes) -> str:
    """Return UTF-8 for what reads as that; else Latin-1, which has a letter for every byte."""
    try:
        text.decode()
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


@dataclass(frozen=True, eq=False)
class Text:
    """A text, cut into lines and words; a comment is blank.

    Attributes:
        what: the file, for errors.
        letters: the text.
        starts: (L,) where lines begin.
        begins, ends: (W,) where words begin and end.
        first: (L,) the first word of each line.
        counts: (L,) how many words it has.
        before: lines of the file above the text.
    """

    what: str
    letters: UInt8[np.ndarray, " N"]
    starts: Int[np.ndarray, " L"]
    begins: Int[np.ndarray, " W"]
    ends: Int[np.ndarray, " W"]
    first: Int[np.ndarray, " L"]
    counts: Int[np.ndarray, " L"]
    before: int = 0

    def word_fault(self, word: int, problem: str) -> UnreadableError:
        """Return the error of a word that cannot be read."""
        line = int(np.searchsorted(self.starts, self.begins[word], "right")) - 1
        return self.fault(line, f"{name_of(self.word(word)[:40])!r} is {problem}")

    def fault(self, line: int, problem: str) -> UnreadableError:
        """Return the error of a line that cannot be read."""
        above = self.letters[: self.starts[line]]
        # As editors count: continued lines are several.
        number = self.before + line + 1 + int(np.count_nonzero(above == _JOINED[1]))
        return UnreadableError(f"line {number} of the {self.what} file: {problem}")

    def keyword(self, word: bytes) -> Bool[np.ndarray, " L"]:
        """Return which lines begin with a word."""
        known = np.flatnonzero(self.counts)
        at = self.first[known]
        found = np.zeros(len(self.counts), dtype=bool)
        found[known] = self.is_word(word, at)
        return found

    def is_word(self, word: bytes, at: Int[np.ndarray, " K"]) -> Bool[np.ndarray, " K"]:
        """Return which of some words are `word`, in small letters or in capitals."""
        begins = self.begins[at]
        same = self.ends[at] - begins == len(word)
        for place, letter in enumerate(word):
            some = np.flatnonzero(same)
            same[some] = (self.letters[begins[some] + place] | 32) == letter
        return same

    def words_of(self, lines: Bool[np.ndarray, " L"]) -> Int[np.ndarray, " K"]:
        """Return the words of some lines but the first of each."""
        counts = self.counts[lines] - 1
        firsts = np.repeat(self.first[lines] + 1 - (np.cumsum(counts) - counts), counts)
        return firsts + np.arange(len(firsts))

    def cut(self, words: Int[np.ndarray, " K"]) -> UInt8[np.ndarray, " n"]:
        """Return the letters of some words in ascending order, with blanks between them."""
        if not len(words):
            return np.zeros(0, dtype=np.uint8)
        # Between the first and the last alone: files have their positions in one place.
        begin = self.begins[words[0]]
        letters = self.letters[begin : self.ends[words[-1]] + 1]
        # One more letter, so that the blank behind the last word is there.
        inside = np.zeros(len(letters) + 1, dtype=np.int8)
        inside[self.begins[words] - begin] = 1
        inside[np.minimum(self.ends[words] + 1 - begin, len(letters))] -= 1
        taken = np.cumsum(inside, dtype=np.int8, out=inside)[:-1].view(bool)
        return np.append(letters[taken], np.uint8(_BLANK))

    def numbers(
        self, words: Int[np.ndarray, " K"], dtype: type = np.float64
    ) -> Shaped[np.ndarray, " K"]:
        """Read words as numbers. Raises UnreadableError with the line of one that is none."""
        values = parsed(self.cut(words).tobytes(), dtype)
        if len(values) != len(words):
            bad = next((w for w in words.tolist() if not is_number(self.word(w), dtype)), 0)
            raise self.word_fault(bad, "no number")
        return values

    def word(self, number: int) -> bytes:
        """Return a word."""
        return self.letters[self.begins[number] : self.ends[number]].tobytes()


def is_number(word: bytes, dtype: type = np.float64) -> bool:
    """Return whether a word is a number as mesh files write them."""
    if _NUMBER.fullmatch(word) is None:
        return False
    return dtype is np.float64 or word.lstrip(b"+-").isdigit()


def parsed(text: bytes, dtype: type = np.float64) -> Shaped[np.ndarray, " K"]:
    """Read numbers up to the first word that is none; fewer or more than words where one is not."""
    with warnings.catch_warnings():
        # numpy warns where it stops; the count tells it.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=dtype, sep=" ")
        except ValueError:
            return np.zeros(0, dtype=dtype)


def count_words(text: bytes) -> int:
    """Count what blanks divide."""
    filled = np.frombuffer(text, dtype=np.uint8) > _BLANK
    return int(np.count_nonzero(filled[1:] > filled[:-1])) + bool(filled[:1].any())


def cut_text(
    text: bytes, what: str, before: int = 0, *, continued: bool = False, comments: bool = True
) -> Text:
    """Cut a plain text into lines and words, as `plain_letters` makes them."""
    letters, ends = plain_letters(text, continued=continued, comments=comments)
    starts = np.append(0, ends + 1)
    # With a blank before the first letter and one behind the last.
    filled = np.zeros(len(letters) + 2, dtype=bool)
    np.greater(letters, _BLANK, out=filled[1:-1])
    turns = np.flatnonzero(filled[1:] != filled[:-1])
    begins, word_ends = turns[::2], turns[1::2]
    first = np.searchsorted(begins, starts)
    counts = np.diff(first, append=len(begins))
    return Text(what, letters, starts, begins, word_ends, first, counts, before)


def plain_letters(
    text: bytes, *, continued: bool, comments: bool = True
) -> tuple[UInt8[np.ndarray, " N"], Int[np.ndarray, " E"]]:
    """Return a text, and where its lines end; comments are blank, if # begins one.

    `continued` joins a line that ends with a backslash, outside of a comment, with the next.
    """
    letters = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(letters == _LINE_END)
    if comments and _COMMENT in text:
        letters = _without_comments(letters, ends)
    if continued and _BACKSLASH in text:
        letters = np.append(letters, np.uint8(_LINE_END))
        at = np.flatnonzero((letters[:-1] == _BACKSLASH) & (letters[1:] == _LINE_END))
        letters[at], letters[at + 1] = _JOINED
        letters = letters[:-1]
        ends = np.flatnonzero(letters == _LINE_END)
    return letters, ends


def _without_comments(
    letters: UInt8[np.ndarray, " N"], ends: Int[np.ndarray, " L"]
) -> UInt8[np.ndarray, " N"]:
    """Return the letters with blanks from the first # of each line to its end."""
    marks = np.flatnonzero(letters == _COMMENT)
    line = np.searchsorted(ends, marks)
    marks = marks[np.diff(line, prepend=-1) > 0]
    inside = np.zeros(len(letters) + 1, dtype=np.int8)
    inside[marks] = 1
    inside[np.append(ends, len(letters))[np.unique(line)]] -= 1
    comment = np.cumsum(inside, dtype=np.int8, out=inside)[:-1].view(bool)
    blank = letters.copy()
    blank[comment] = _BLANK
    return blank


def rows_text(form: str, rows: Shaped[np.ndarray, "N K"]) -> Iterator[bytes]:
    """Write each row by a form of printf for all of its numbers, of %.12g or %.7g, or of %d."""
    kinds, parts = _PLACE.findall(form), [part.encode() for part in _PLACE.split(form)]
    letters = np.frombuffer(b"".join(parts), dtype=np.int8)
    between = letters, np.cumsum([len(part) for part in parts])
    kind = kinds[0] if len(set(kinds)) == 1 else ""
    whole = kind == "%d" and rows.dtype.kind in "iu"
    # A whole number has 19 digits at most; others a sign, a point, and zeros or an exponent.
    longest = 19 if whole else _DIGITS.get(kind, 0) + 7
    out = np.empty(min(BLOCK, len(rows)) * (len(letters) + longest * len(kinds)), dtype=np.int8)
    begin = 0
    while begin < len(rows):
        block, count, end = rows[begin : begin + BLOCK], 0, 0
        if whole:
            given = np.ascontiguousarray(block, np.int64)
            count, end = kernels.write_wholes(given, *between, out)
        elif kind in _DIGITS:
            given = np.ascontiguousarray(block, np.float64)
            count, end = kernels.write_numbers(given, _DIGITS[kind], *between, POWERS, WHOLES, out)
        yield out[:end].tobytes()
        begin += count
        if count < len(block):
            yield (form % tuple((rows[begin] + 0).tolist())).encode()  # no −0
            begin += 1
