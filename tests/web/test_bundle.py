"""The committed bundle is what its sources and its lock file make."""

from __future__ import annotations

import fcntl
import json
import shutil
import subprocess
from pathlib import Path

import pytest

from service.http.pages import PAGE

WEB = Path(__file__).resolve().parents[2] / "web"


@pytest.fixture(scope="module", autouse=True)
def packages() -> None:
    """Install what the lock file pins, without letting any package run a script."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("needs node and npm")
    wanted = json.loads((WEB / "package-lock.json").read_text())["packages"]
    with (WEB / ".install.lock.tmp").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        installed = WEB / "node_modules" / ".package-lock.json"
        linked = json.loads(installed.read_text())["packages"] if installed.exists() else {}
        if any(linked[name]["version"] != wanted[name]["version"] for name in linked) or not linked:
            command = ["npm", "ci", "--ignore-scripts", "--silent", "--no-audit", "--no-fund"]
            subprocess.run(command, cwd=WEB, check=True)


def test_the_bundle_is_rebuilt_byte_for_byte(tmp_path: Path) -> None:
    subprocess.run(["node", "build.mjs", str(tmp_path)], cwd=WEB, check=True, capture_output=True)
    assert contents(tmp_path) == contents(PAGE)


def test_the_sources_pass_the_strict_type_checker() -> None:
    done = subprocess.run(
        ["node", "node_modules/typescript/bin/tsc", "--noEmit"],
        cwd=WEB,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def contents(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
