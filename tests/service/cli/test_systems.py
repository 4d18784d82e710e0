"""The command line does its work where POSIX is missing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def pns_without_posix(folder, *arguments):
    command = (sys.executable, "-m", "tests.support.without_posix", *arguments)
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_files_are_refined_without_posix(tmp_path, part_file):
    for arguments in (
        ("example", "other.glb"),
        ("subdivide", "other.glb", "-o", "finer.glb", "--report", "report.json"),
        ("info",),
        ("key", "studio"),
    ):
        done = pns_without_posix(tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "other.glb").read_bytes() == part_file.read_bytes()
    assert (tmp_path / "finer.glb").exists()
    assert (tmp_path / "report.json").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("serve", "--port", "0"),
        ("batch", ".", "refined", "--report", "report.jsonl"),
    ],
)
def test_what_needs_posix_says_so(tmp_path, part_file, arguments):
    before = sorted(tmp_path.iterdir())
    done = pns_without_posix(tmp_path, *arguments)
    assert done.returncode == 1
    assert done.stderr.startswith(f"pns: pns {arguments[0]} needs a POSIX system")
    assert len(done.stderr.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before
