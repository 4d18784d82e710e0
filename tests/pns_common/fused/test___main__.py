"""`python -m pns_common.fused`: says where kernels are, or why there are none."""

import runpy

import pytest

from pns_common import fused
from pns_common.fused.storage import cache_folder


def run():
    runpy.run_module("pns_common.fused", run_name="__main__")


def test_it_says_where_the_kernels_are(capsys):
    run()
    assert capsys.readouterr().out == f"kernels are in {cache_folder()}\n"


def test_it_fails_where_there_can_be_none(monkeypatch):
    monkeypatch.setattr(fused, "load_kernels", lambda: False)
    with pytest.raises(SystemExit, match="numba is not installed, or no folder"):
        run()
