"""The version, as what is installed has it."""

from importlib import metadata

import pytest

from pns_common.version import VERSION


def test_the_version_is_that_of_the_package():
    try:
        installed = metadata.version("pns-subdivision")
    except metadata.PackageNotFoundError:
        pytest.skip("run from the sources")
    assert installed == VERSION
