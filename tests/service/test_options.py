"""Options are valid once constructed."""

import inspect
import math
import subprocess
import sys
from dataclasses import asdict

import pytest

from service.cli.commands import subdivide
from service.errors import InvalidParameter
from service.http.parameters import Parameters
from service.options import Options
from tests.support.added_scheme import TRIANGLE, halved, with_linear

WRONG = [
    ("levels", 0),
    ("levels", 7),
    ("levels", -1),
    ("scheme", "butterfly"),
    ("diagnostics", "some"),
    ("budget", -0.1),
    ("budget", math.nan),
    ("budget", math.inf),
    ("reference_length", 0.0),
    ("reference_length", -1.0),
    ("reference_length", math.nan),
    ("reference_length", math.inf),
    ("uv", "cubic"),
    ("normals", "hard"),
    ("normals", "limit"),
    ("crease", "on"),
    ("crease", "lines"),
    ("crease", "angle"),
    ("crease", "angle:"),
    ("crease", "angle:-3"),
    ("crease", "angle:181"),
    ("crease", "angle:nan"),
    ("crease", "normals\n"),
    ("weld_tolerance", -1e-9),
    ("weld_tolerance", 0.011),
    ("weld_tolerance", math.nan),
]


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_a_value_outside_its_range_is_refused_by_name(name, value):
    with pytest.raises(InvalidParameter) as refusal:
        Options(**{name: value})
    assert refusal.value.name == name
    assert refusal.value.status == 422


def test_a_wrong_choice_is_answered_with_all_there_are():
    with pytest.raises(InvalidParameter, match="border must be one of smooth, corners, fixed"):
        Options(border="round")


def test_a_wrong_crease_is_answered_with_an_example():
    with pytest.raises(InvalidParameter, match="as in 'angle:40'"):
        Options(crease="on")


def test_the_command_line_and_http_take_these_options_with_their_defaults():
    own = asdict(Options())
    over_http = {name: field.default for name, field in Parameters.model_fields.items()}
    assert over_http == {**own, "model": None, "format": "glb"}
    on_the_line = {n: p.default for n, p in inspect.signature(subdivide).parameters.items()}
    assert {name: on_the_line[name] for name in own} == own


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
