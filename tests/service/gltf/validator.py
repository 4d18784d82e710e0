"""Khronos's glTF validator, run by node at the version that tests/node/package-lock.json pins."""

import fcntl
import json
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

NODE_FOLDER = Path(__file__).resolve().parents[2] / "node"


def errors(paths):
    """For each file the validator's error codes, sorted; skips the test where node is absent."""
    _install()
    command = ["node", "validate.mjs", *map(str, paths)]
    run = subprocess.run(command, cwd=NODE_FOLDER, check=True, capture_output=True, text=True)
    messages = json.loads(run.stdout)
    return [
        sorted({m["code"] for m in messages[str(path)] if m["severity"] == 0}) for path in paths
    ]


@cache
def _install():
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("needs node and npm, to run Khronos's glTF validator")
    # Several test processes may come here at once.
    with (NODE_FOLDER / ".install.lock.tmp").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (NODE_FOLDER / "node_modules" / "gltf-validator").exists():
            subprocess.run(["npm", "ci", "--silent"], cwd=NODE_FOLDER, check=True)
