"""`python -m pns_common.fused`: says where kernels are, or why there are none."""

import runpy

import pytest

from pns_common import fused
from pns_common.fused import library
from pns_common.fused.storage import BUILT, cache_folder


def run():
    runpy.run_module("pns_common.fused", run_name="__main__")


def test_it_says_where_the_kernels_are(capsys):
    run()
    said = capsys.readouterr().out
    assert said in {f"kernels are in {folder}\n" for folder in (BUILT, cache_folder())}


def test_it_fails_where_there_can_be_none(monkeypatch):
    monkeypatch.setattr(fused, "load_kernels", lambda: False)
    with pytest.raises(SystemExit, match="numba is not installed, or no folder"):
        run()


def test_it_fails_where_they_cannot_be_kept(monkeypatch, tmp_path):
    """Else an image would be built without them, and each of its starts compile."""
    monkeypatch.setattr(library, "kernel_file", lambda key: tmp_path / f"{key}.o")
    with pytest.raises(SystemExit, match=f"not kept: {tmp_path} is full, or cannot be written"):
        run()
