"""The command line in an empty folder, and a part to refine there."""

from __future__ import annotations

import sys
from typing import NamedTuple

import pytest

from service import cli
from service.meshfiles.example import part_glb


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def pns(monkeypatch, capfd, tmp_path):
    """Run a command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["pns", *arguments])
        with pytest.raises(SystemExit) as exit_:
            cli.main()
        captured = capfd.readouterr()
        return Outcome(exit_.value.code or 0, captured.out, captured.err)

    return run


@pytest.fixture
def part_file(tmp_path):
    path = tmp_path / "part.glb"
    path.write_bytes(part_glb())
    return path
