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
