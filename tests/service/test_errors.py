"""Errors cross from worker processes: what they carry must arrive."""

import inspect
import pickle

import pytest

from service import errors
from service.errors import ServiceError

EXAMPLES = [
    errors.ServiceError("plain", pointer="/a"),
    errors.UnreadableError("cut off"),
    errors.LimitError("too many", limit="faces", allowed=1, found=2),
    errors.MediaTypeError("text/html"),
    errors.GltfError("index 9", pointer="/accessors/3"),
    errors.UnsupportedFeature("a triangle strip", pointer="/meshes/0"),
    errors.UnrefinableError("no face"),
    errors.InvalidParameter("model", "model must be one of a, b", choices=["a", "b"]),
    errors.BusyError(retry_after=7),
    errors.UnauthorizedError("no key"),
    errors.NoModelError("none"),
    errors.NoStorageError("5 bytes do not fit"),
    errors.JobTimeout("60 s"),
    errors.WorkerDied("signal 9"),
]


def test_every_kind_has_an_example():
    kinds = {kind for _, kind in inspect.getmembers(errors, inspect.isclass)}
    assert {type(error) for error in EXAMPLES} == {k for k in kinds if issubclass(k, ServiceError)}


@pytest.mark.parametrize("error", EXAMPLES, ids=lambda error: type(error).__name__)
def test_errors_survive_pickling_with_all_their_data(error):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert vars(copy) == vars(error)
    assert str(copy) == str(error)


@pytest.mark.parametrize("error", EXAMPLES, ids=lambda error: type(error).__name__)
def test_no_error_keeps_more_of_an_upload_than_a_page(error):
    kind = type(error)
    if kind is errors.InvalidParameter:
        long = kind("model", "x" * 10**6)
    elif kind is errors.LimitError:
        long = kind("x" * 10**6, limit="faces", allowed=1, found=2)
    elif kind in (errors.BusyError, errors.JobTimeout, errors.WorkerDied):
        long = kind("x" * 10**6)
    else:
        long = kind("x" * 10**6, pointer="/a/" + "b" * 10**6)
    assert len(str(long)) < 10_000
    assert long.pointer in (None, "/a")


def test_codes_are_slugs_of_their_own():
    codes = [type(error).code for error in EXAMPLES]
    assert len(set(codes)) == len(codes)
    assert all(code == code.lower().replace(" ", "-") for code in codes)


def test_the_text_names_the_place():
    assert str(errors.GltfError("index 9", pointer="/accessors/3")) == "index 9 (at /accessors/3)"


def test_a_limit_allows_what_it_says_and_refuses_one_more():
    errors.check_limit("faces", 5, 5, "there are 5 faces")
    with pytest.raises(errors.LimitError) as refusal:
        errors.check_limit("faces", 6, 5, "there are 6 faces")
    error = refusal.value
    assert (error.limit, error.found, error.allowed) == ("faces", 6, 5)
    assert str(error) == "there are 6 faces, more than 5"


def test_a_choice_is_one_of_what_there_is_or_lists_it():
    errors.check_choice("scheme", "loop", ("pns", "loop"))
    with pytest.raises(errors.InvalidParameter) as refusal:
        errors.check_choice("scheme", "Loop", ("pns", "loop"))
    assert (refusal.value.name, refusal.value.choices) == ("scheme", ("pns", "loop"))
    assert str(refusal.value) == "scheme must be one of pns, loop"
