"""PYTHONOPTIMIZE strips asserts; nothing that a stranger meets may hang on one."""

import ast
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

REFUSALS = """
import sys, time
from fastapi.testclient import TestClient
from service.http.app import create_app
from service.settings import Settings
from tests.support import stand_in_jobs as jobs
from tests.support.live import local

def main():
    if not sys.flags.optimize:
        raise SystemExit("not optimised")
    stand_ins = {"job": jobs.obey, "warm_up": jobs.no_warm_up}
    with local(create_app(Settings(workers=1, body=1000), **stand_ins)) as client:
        glb = {"Content-Type": "model/gltf-binary"}
        def status(path="/subdivide", body=b"x", **headers):
            return client.post(path, content=body, headers=glb | headers).status_code
        while status() != 200:
            time.sleep(0.05)
        seen = [status(), status(body=bytes(1001)), status("/subdivide?levels=7"),
                status(body=b"unreadable"), status(body=b"fault"), status("/nothing"),
                client.post("/subdivide", content=b"x").status_code]
    print(seen)

if __name__ == "__main__":
    main()
"""


def test_refusals_are_the_same_without_asserts(tmp_path):
    """At level 2, which strips what 1 does, and docstrings besides."""
    script = tmp_path / "refusals.py"
    script.write_text(REFUSALS)
    environment = os.environ | {"PYTHONOPTIMIZE": "2", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(script)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str([200, 413, 422, 400, 500, 404, 415])


def test_the_service_asserts_nothing():
    for path in sorted((ROOT / "service").rglob("*.py")):
        nodes = ast.walk(ast.parse(path.read_text()))
        asserts = [node.lineno for node in nodes if isinstance(node, ast.Assert)]
        assert not asserts, f"{path}:{asserts}"
