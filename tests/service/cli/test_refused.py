"""A refusal is one line and an exit code, and leaves everything as it was."""

import stat

import msgspec
import pytest

from pns_common.model.file import bundled_models
from service import cli
from service.cli import commands
from service.cli.errors import explained
from service.meshfiles.example import part_glb
from tests.service.cli.trees import tree_of_bytes

NAMED = "bundled name (" + ", ".join(bundled_models(companions=True))
URL = "https://example.org/part.glb"


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ("missing.glb -o out.glb", 1, "missing.glb"),
        ("part.glb", 2, "--output"),
        ("part.glb -o nowhere/out.glb", 2, "nowhere/out.glb: there is no folder nowhere\n"),
        ("part.glb -o out.glb --report nowhere/report.json", 2, "nowhere"),
        ("part.glb -o out.fbx", 2, "out.fbx"),
        ("part.txt -o out.glb", 2, "part.txt"),
        *((f"part.glb -o out.glb --levels {levels}", 2, "levels") for levels in (0, 7)),
        *((f"part.glb -o out.glb --budget {budget}", 2, "budget") for budget in ("nan", "much")),
        ("part.glb -o out.glb --scheme cubic", 2, "scheme"),
        ("part.glb -o out.glb --reference-length long", 2, "reference-length"),
        ("part.glb -o out.glb --reference-length 0", 2, "reference_length"),
        ("part.glb -o out.glb --model missing.onnx", 1, "missing.onnx"),
        *((f"part.glb -o o.glb --model pape {more}", 1, NAMED) for more in ("", "--scheme loop")),
        ("part.glb -o out.glb --model ./paper", 1, "./paper"),
        ("part.glb -o out.glb --model part.glb", 1, "model part"),
        ("part.glb -o out.glb --levels 6", 1, "faces"),
        ("broken.glb -o out.glb", 1, "GLB"),
        # With the file, and what was there before stays.
        ("broken.ply -o precious.glb", 1, "broken.ply: this is not a PLY"),
        ("bad.obj -o out.obj", 1, "bad.obj: line 3 "),
        ("external.gltf -o out.glb", 1, "buffer"),
        # Nothing is replaced unless it is asked for, a model by a report never.
        ("part.glb -o ./part.glb", 2, "--force"),
        ("part.glb -o .", 2, "--force"),
        ("part.glb -o same.glb --report same.glb", 2, "same.glb"),
        ("part.glb -o same.glb --report folder/../same.glb", 2, "folder/../same.glb"),
        ("part.glb -o out.glb --report part.glb", 2, "part.glb"),
        ("part.glb part.glb -o out.glb", 2, "several files need a folder"),
        ("part.glb ./part.glb -o folder", 2, "two files would be written"),
        (f"{URL} -o out.glb", 2, "is a URL"),
        (f"part.glb -o {URL}", 2, "is a URL"),
        ("! info missing", 1, NAMED),
        ("! info part.glb", 1, "ONNX"),
        ("! example part.obj", 2, "part.obj"),
        ("! example nowhere/out.glb", 1, "pns: nowhere/out.glb: No such file or directory\n"),
        ("! serve --port 70000", 2, "port"),
        ("! key Studio", 1, "a name is 1 to 63 of"),
    ],
)
def test_errors_are_one_line_and_leave_everything_as_it_was(
    pns, tmp_path, part_file, arguments, code, says
):
    tree = tree_of_bytes(part_glb())
    tree["buffers"][0]["uri"] = "part.bin"
    given = {"broken.glb": b"no", "broken.ply": b"no", "precious.glb": b"precious"}
    given["bad.obj"] = b"v 0 0 0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n"
    given["external.gltf"] = msgspec.json.encode(tree)
    for name, content in given.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.ply").mkdir()

    def seen():
        return {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}

    before = seen()
    words = arguments.split()
    outcome = pns(*(words[1:] if words[0] == "!" else ["subdivide", *words]))
    assert outcome.code == code, outcome.err
    assert says in outcome.err
    assert outcome.out == ""
    assert "Traceback" not in outcome.err
    if outcome.err.startswith("pns:"):
        assert outcome.err.count("\n") == 1
    assert seen() == before


def test_output_has_the_permissions_of_any_new_file(pns, tmp_path, part_file):
    pns("subdivide", str(part_file), "-o", "out.glb")
    (tmp_path / "plain").touch()
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("out.glb", "plain")}
    assert len(modes) == 1


@pytest.mark.parametrize(
    ("setting", "value"), [("PNS_FACES", "1000"), ("PNS_MEMORY", "1MiB"), ("PNS_JSON_ITEMS", "9")]
)
def test_a_limit_names_the_setting_that_raises_it(pns, part_file, monkeypatch, setting, value):
    monkeypatch.setenv(setting, value)
    outcome = pns("subdivide", "part.glb", "-o", "out.glb")
    assert outcome.code == 1
    assert f"{setting} allows more" in outcome.err


def test_a_fault_of_ours_is_a_traceback(pns, monkeypatch):
    def fault():
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(commands, "app", fault)
    with pytest.raises(ZeroDivisionError):
        cli.main()


def test_an_error_of_the_system_without_a_number_is_told_in_its_own_words():
    assert explained(OSError("the stream is closed")) == ("output: the stream is closed", 1)
