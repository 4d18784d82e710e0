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

NAMES = ", ".join(bundled_models(companions=True))


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ("subdivide missing.glb -o out.glb", 1, "missing.glb"),
        ("subdivide part.glb -o nowhere/out.glb", 2, "nowhere"),
        ("subdivide part.glb -o out.glb --report nowhere/report.json", 2, "nowhere"),
        ("subdivide part.glb -o out.fbx", 2, "out.fbx"),
        ("subdivide part.txt -o out.glb", 2, "part.txt"),
        ("subdivide part.glb -o out.glb --levels 0", 2, "levels"),
        ("subdivide part.glb -o out.glb --levels 7", 2, "levels"),
        ("subdivide part.glb -o out.glb --budget nan", 2, "budget"),
        ("subdivide part.glb -o out.glb --budget much", 2, "budget"),
        ("subdivide part.glb -o out.glb --scheme cubic", 2, "scheme"),
        ("subdivide part.glb -o out.glb --reference-length long", 2, "reference-length"),
        ("subdivide part.glb -o out.glb --reference-length 0", 2, "reference_length"),
        ("subdivide part.glb -o out.glb --model missing.onnx", 1, "missing.onnx"),
        ("subdivide part.glb -o out.glb --model pape", 1, "bundled name (" + NAMES),
        ("subdivide part.glb -o out.glb --model pape --scheme loop", 1, "bundled name (" + NAMES),
        ("subdivide part.glb -o out.glb --model ./paper", 1, "./paper"),
        ("subdivide part.glb -o out.glb --model part.glb", 1, "model part"),
        ("subdivide part.glb -o out.glb --levels 6", 1, "faces"),
        ("subdivide broken.glb -o out.glb", 1, "GLB"),
        ("subdivide broken.ply -o out.glb", 1, "PLY"),
        ("subdivide external.gltf -o out.glb", 1, "buffer"),
        ("info missing", 1, "bundled name (" + NAMES),
        ("info part.glb", 1, "ONNX"),
        ("example part.obj", 2, "part.obj"),
        ("serve --port 70000", 2, "port"),
        ("subdivide part.glb", 2, "--output"),
    ],
)
def test_errors_are_one_line_and_leave_no_file(pns, tmp_path, part_file, arguments, code, says):
    (tmp_path / "broken.glb").write_bytes(b"no")
    (tmp_path / "broken.ply").write_bytes(b"no")
    tree = tree_of_bytes(part_glb())
    tree["buffers"][0]["uri"] = "part.bin"
    (tmp_path / "external.gltf").write_bytes(msgspec.json.encode(tree))
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.ply").mkdir()
    before = set(tmp_path.iterdir())
    outcome = pns(*arguments.split())
    assert outcome.code == code, outcome.err
    assert says in outcome.err
    assert "Traceback" not in outcome.err
    if outcome.err.startswith("pns:"):
        assert outcome.err.count("\n") == 1
    assert set(tmp_path.iterdir()) == before


def test_a_failure_keeps_the_file_that_was_there(pns, tmp_path):
    (tmp_path / "out.glb").write_text("precious")
    (tmp_path / "broken.glb").write_bytes(b"no")
    assert pns("subdivide", "broken.glb", "-o", "out.glb").code == 1
    assert (tmp_path / "out.glb").read_text() == "precious"


def test_output_has_the_permissions_of_any_new_file(pns, tmp_path, part_file):
    pns("subdivide", str(part_file), "-o", "out.glb")
    (tmp_path / "plain").touch()
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("out.glb", "plain")}
    assert len(modes) == 1


@pytest.mark.parametrize(
    ("output", "report"),
    [("same.glb", "same.glb"), ("same.glb", "sub/../same.glb"), ("out.glb", "part.glb")],
)
def test_a_report_never_replaces_a_model(pns, tmp_path, part_file, output, report):
    (tmp_path / "sub").mkdir()
    outcome = pns("subdivide", "part.glb", "-o", output, "--report", report)
    assert outcome.code == 2
    assert report in outcome.err
    assert part_file.read_bytes() == part_glb()
    assert not (tmp_path / "same.glb").exists()


def test_a_missing_folder_is_named_with_the_file_that_was_asked_for(pns, part_file):
    outcome = pns("subdivide", "part.glb", "-o", "nowhere/out.glb")
    assert outcome.err == "pns: nowhere/out.glb: there is no folder nowhere\n"
    outcome = pns("example", "nowhere/out.glb")
    assert outcome.err == "pns: nowhere/out.glb: No such file or directory\n"


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
