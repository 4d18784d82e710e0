"""Errors carry what they are about, say it, and cross to another process."""

import pickle

import pytest

from pns_common.errors import MeshError, ModelError, ParameterError, PnsError

ERRORS = {
    "mesh": (MeshError("no area", element="face", index=3), "face 3: no area"),
    "whole mesh": (MeshError("no faces", element="faces"), "faces: no faces"),
    "nowhere": (MeshError("broken"), "broken"),
    "model": (
        ModelError("a.onnx", expected="one graph", found="two"),
        "model a.onnx: expected one graph, found two",
    ),
    "parameter": (
        ParameterError("levels", "2", expected="a whole number"),
        "levels = '2': expected a whole number",
    ),
}


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_says_what_it_carries(name):
    error, text = ERRORS[name]
    assert str(error) == text
    assert isinstance(error, PnsError)


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_crosses_to_another_process_with_its_data(name):
    """A pool of processes that cannot read an error waits for ever."""
    error, text = ERRORS[name]
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), str(copy), copy.__dict__) == (type(error), text, error.__dict__)
