"""Options are valid once constructed, and the same at every door."""

import inspect
import math
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from pns_common import Mesh, loop, pyvista, refine, subdivide
from service.cli import commands
from service.errors import InvalidParameter
from service.http.parameters import Parameters
from service.options import Options
from tests.support.added_scheme import TRIANGLE, halved, with_linear
from tests.support.meshes import bumpy_sphere

ROOT = Path(__file__).resolve().parents[2]
ANGLES = ("angle", "angle:", "angle:-3", "angle:181", "angle:nan")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("levels", value) for value in (0, 7, -1)),
        *(("budget", value) for value in (-0.1, math.nan, math.inf)),
        *(("reference_length", value) for value in (0.0, -1.0, math.nan, math.inf)),
        *(("weld_tolerance", value) for value in (-1e-9, 0.011, math.nan)),
        *(("scheme", "butterfly"), ("diagnostics", "some"), ("uv", "cubic")),
        *(("normals", value) for value in ("hard", "limit")),
        *(("crease", value) for value in ("on", "lines", "normals\n", *ANGLES)),
    ],
)
def test_a_value_outside_its_range_is_refused_by_name(name, value):
    with pytest.raises(InvalidParameter) as refused:
        Options(**{name: value})
    assert (refused.value.name, refused.value.status) == (name, 422)


def test_a_wrong_choice_is_answered_with_all_there_are_or_an_example():
    with pytest.raises(InvalidParameter, match="border must be one of smooth, corners, fixed"):
        Options(border="round")
    with pytest.raises(InvalidParameter, match="as in 'angle:40'"):
        Options(crease="on")


def test_the_command_line_and_http_take_these_options_with_their_defaults():
    own = asdict(Options())
    over_http = {name: field.default for name, field in Parameters.model_fields.items()}
    assert over_http == {**own, "model": None, "format": "glb"}
    parameters = inspect.signature(commands.subdivide).parameters
    assert {name: parameters[name].default for name in own} == own


def test_two_levels_are_made_at_every_door():
    """None is two, or as many as a goal needs."""
    for door in (refine, subdivide, pyvista.PnsAccessor.subdivide, pyvista.PnsAccessor.loop):
        assert inspect.signature(door).parameters["levels"].default in (None, 2)
    mesh = Mesh(*bumpy_sphere())
    assert refine(mesh, loop()).mesh.face_count == mesh.face_count * 4**2
    for file, pattern in (
        ("addons/blender/pns_refine/settings.py", r"levels: IntProperty\([^)]*?default=(\d)"),
        ("web/src/settings.ts", r"DEFAULTS: Settings = \{\s*levels: (\d)"),
    ):
        assert re.findall(pattern, (ROOT / file).read_text()) == ["2"]


def test_a_file_and_a_line_make_a_base_scheme_known_to_the_command_line(tmp_path):
    (tmp_path / "in.obj").write_text(TRIANGLE)
    arguments = ["subdivide", "in.obj", "-o", "out.obj", "--scheme", "linear", "--levels", "1"]
    done = subprocess.run(
        [sys.executable, "-c", "from service.cli import main; main()", *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=with_linear(tmp_path) | {"PATH": ""},
    )
    assert done.returncode == 0, done.stderr
    assert halved((tmp_path / "out.obj").read_text())
