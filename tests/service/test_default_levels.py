"""Two levels at every door: one shows little."""

import inspect
import re
from pathlib import Path

import pytest

from pns_common import Mesh, loop, pyvista, refine, subdivide
from tests.support.meshes import bumpy_sphere

ROOT = Path(__file__).resolve().parents[2]
DEFAULT_LEVELS = 2


@pytest.mark.parametrize(
    "door",
    [refine, subdivide, pyvista.PnsAccessor.subdivide, pyvista.PnsAccessor.loop],
    ids=lambda door: door.__qualname__,
)
def test_python_refines_by_two_levels(door):
    """None is two, or as many as a goal needs."""
    assert inspect.signature(door).parameters["levels"].default in (None, DEFAULT_LEVELS)
    mesh = Mesh(*bumpy_sphere())
    assert refine(mesh, loop()).mesh.face_count == mesh.face_count * 4**DEFAULT_LEVELS


@pytest.mark.parametrize(
    ("file", "pattern"),
    [
        ("addons/blender/pns_refine/settings.py", r"levels: IntProperty\([^)]*?default=(\d)"),
        ("web/src/settings.ts", r"DEFAULTS: Settings = \{\s*levels: (\d)"),
    ],
)
def test_blender_and_the_page_refine_as_deep_as_python(file, pattern):
    (depth,) = re.findall(pattern, (ROOT / file).read_text())
    assert int(depth) == DEFAULT_LEVELS
