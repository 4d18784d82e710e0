"""Scripts of tests/node, run once for many files, at the versions that its lock file pins."""

import fcntl
import json
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "node"


def run(script, paths):
    """Return what a script prints over files, by path. Skips the test where node is absent."""
    install()
    command = ["node", script, *map(str, paths)]
    done = subprocess.run(command, cwd=FOLDER, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


@cache
def install():
    """Install what the lock file pins, once. Skips the test where node is absent."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("needs node and npm")
    wanted = json.loads((FOLDER / "package.json").read_text())["dependencies"]
    # Several test processes may come here at once.
    with (FOLDER / ".install.lock.tmp").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if any(_installed(name) != version for name, version in wanted.items()):
            subprocess.run(["npm", "ci", "--silent"], cwd=FOLDER, check=True)


def _installed(name):
    manifest = FOLDER / "node_modules" / name / "package.json"
    return json.loads(manifest.read_text())["version"] if manifest.exists() else None
