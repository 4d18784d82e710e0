"""Imports between packages, seen from a running interpreter; lint-imports holds the static side."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def loaded_by(module):
    code = f"import sys, {module}; print('\\n'.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return set(done.stdout.split())


@pytest.mark.parametrize("module", ["pns_common", "service.http.app", "service.cli"])
def test_the_product_never_loads_torch(module):
    assert not loaded_by(module) & {"torch", "train", "export"}


def test_the_operator_loads_no_web_framework():
    assert not loaded_by("pns_common") & {"fastapi", "starlette", "trimesh", "service"}


def test_no_module_is_called_like_one_of_the_standard_library():
    """`python train/run.py` puts train/ first on the path, where it would hide the real one."""
    for package in ("train", "export"):
        names = {path.stem for path in (ROOT / package).glob("*.py")} - {"__init__"}
        assert not names & sys.stdlib_module_names


def test_importing_the_library_compiles_and_loads_nothing():
    assert not loaded_by("pns_common") & {"numba", "onnxruntime", "onnx", "numpy"}
