"""Each public function shows an example in its docstring, and it holds."""

import doctest
import inspect
import sys

import pytest

import pns_common

SHOWN = [
    name
    for name in pns_common.__all__
    if inspect.isfunction(getattr(pns_common, name)) or name in ("Creases", "Mesh")
]


@pytest.mark.parametrize("name", SHOWN)
def test_the_example_of_a_public_function_holds(name):
    thing = getattr(pns_common, name)
    names = dict(vars(sys.modules[thing.__module__]))
    # Of a class its own docstring: methods say what it says.
    found = doctest.DocTestFinder(recurse=False).find(thing, globs=names)
    assert sum(len(each.examples) for each in found)
    runner = doctest.DocTestRunner()
    for each in found:
        assert runner.run(each).failed == 0
