"""Errors cross from worker processes: what they carry must arrive."""

import inspect
import pickle

import pytest

from service import errors

EXAMPLES = {
    errors.ServiceError: {"pointer": "/a"},
    errors.UnreadableError: {},
    errors.LimitError: {"limit": "faces", "allowed": 1, "found": 2},
    errors.MediaTypeError: {},
    errors.GltfError: {"pointer": "/a/3"},
    errors.UnsupportedFeature: {"pointer": "/a/0"},
    errors.UnrefinableError: {},
    errors.InvalidParameter: {"choices": ["a", "b"]},
    errors.BusyError: {"retry_after": 7},
    errors.UnauthorizedError: {},
    errors.NoModelError: {},
    errors.NoStorageError: {},
    errors.JobTimeout: {},
    errors.WorkerDied: {},
}


def made(kind, text, more=""):
    given = dict(EXAMPLES[kind])
    if "pointer" in given:
        given["pointer"] += more
    return kind(*(["model"] if kind is errors.InvalidParameter else []), text, **given)


def test_every_kind_has_an_example():
    kinds = {kind for _, kind in inspect.getmembers(errors, inspect.isclass)}
    assert set(EXAMPLES) == {kind for kind in kinds if issubclass(kind, errors.ServiceError)}


@pytest.mark.parametrize("kind", EXAMPLES, ids=lambda kind: kind.__name__)
def test_errors_survive_pickling_with_all_their_data_and_keep_a_page_at_most(kind):
    error = made(kind, "words")
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), vars(copy), str(copy)) == (kind, vars(error), str(error))
    long = made(kind, "x" * 10**6, "/" + "b" * 10**6)
    assert len(str(long)) < 10_000
    assert long.pointer in (None, EXAMPLES[kind].get("pointer"))
