"""Imports between packages, seen from a running interpreter; lint-imports holds the static side."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def loaded_by(code):
    code = f"import sys; {code}; print('\\n'.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return set(done.stdout.split())


@pytest.mark.parametrize("module", ["service.http.app", "service.cli"])
def test_the_product_never_loads_torch(module):
    assert not loaded_by(f"import {module}") & {"torch", "train", "export"}


OTHERS = {"torch", "train", "export", "service", "fastapi", "starlette"}
MESHES = {"trimesh", "pyvista", "meshio", "open3d", "vtk"}


def test_importing_the_library_compiles_and_loads_nothing():
    large = {"numba", "onnxruntime", "onnx", "numpy"}
    assert not loaded_by("import pns_common") & (OTHERS | MESHES | large)


def test_arrays_are_refined_without_the_web_and_other_libraries_of_meshes():
    code = (
        "import pns_common; pns_common.subdivide(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))"
    )
    assert not loaded_by(code) & (OTHERS | MESHES)


def test_no_module_is_called_like_one_of_the_standard_library():
    """`python train/run.py` puts train/ first on the path, where it would hide the real one."""
    for package in ("train", "export"):
        names = {path.stem for path in (ROOT / package).glob("*.py")} - {"__init__"}
        assert not names & sys.stdlib_module_names
