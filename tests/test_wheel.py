"""The wheel holds what a user needs, and works without the checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from pns_common.onnx_model import DEFAULT_MODEL

ROOT = Path(__file__).resolve().parents[1]


def run(*arguments, **options):
    done = subprocess.run(arguments, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    # Only what git knows, so that a file that was never added is missed here and not by a user.
    names = run("git", "ls-files", "-z", cwd=ROOT).split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            target = source / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((ROOT / name).read_bytes())
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", out, source)
    (path,) = out.glob("*.whl")
    return path


def test_the_wheel_holds_packages_models_and_licence(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    wanted = {"pns_common/py.typed", "service/cli.py", "train/run.py", "export/run.py"}
    wanted |= {f"pns_common/models/{name}.onnx" for name in ("paper", DEFAULT_MODEL)}
    assert wanted <= names
    assert not any(name.startswith(("tests/", "docs/", "benchmarks/")) for name in names)
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_the_installed_wheel_refines_a_file(wheel, tmp_path):
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    run(*pip, "--target", site, wheel)
    environment = os.environ | {"PYTHONPATH": str(site)}
    where = "import pns_common; print(pns_common.__file__)"
    found = run(sys.executable, "-c", where, cwd=tmp_path, env=environment)
    assert Path(found.strip()).is_relative_to(site)
    for command in (["example", "a.glb"], ["subdivide", "a.glb", "-o", "b.glb"]):
        run(sys.executable, site / "bin" / "pns", *command, cwd=tmp_path, env=environment)
    assert (tmp_path / "b.glb").stat().st_size > (tmp_path / "a.glb").stat().st_size
