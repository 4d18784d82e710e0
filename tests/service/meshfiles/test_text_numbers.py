"""Numbers of text files: what only Python takes for one is none."""

import math

import pytest

from service.errors import UnreadableError
from service.meshfiles import formats
from service.meshfiles.text_numbers import reals, whole


def test_what_is_a_number_is_read():
    assert [whole(word) for word in (b"10", b"-3", b"+2", b"007")] == [10, -3, 2, 7]
    assert reals([[b"1", b".5", b"-2e3"]]).tolist() == [[1.0, 0.5, -2000.0]]
    assert math.isnan(reals([[b"1", None]])[0, 1])


@pytest.mark.parametrize("word", [b"1_0", b"_1", b"one", b"0x1", b""])
def test_what_is_none_is_refused(word):
    with pytest.raises(ValueError, match=r"digit|invalid|convert"):
        whole(word)
    with pytest.raises(ValueError, match=r"digit|convert"):
        reals([[b"1", word]])


@pytest.mark.parametrize(
    ("old", "new"), [("3 0 1 2", "3 0 1 0_2"), ("3 0 1 2", "0_3 0 1 2"), ("0 5 0", "0 5_0 0")]
)
def test_an_off_has_no_digits_apart(old, new):
    text = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 5 0\n3 0 1 2\n"
    assert len(formats.read(text.encode(), "off").faces) == 1
    with pytest.raises(UnreadableError, match=r"the OFF file has a (vertex|face) that is not"):
        formats.read(text.replace(old, new).encode(), "off")
