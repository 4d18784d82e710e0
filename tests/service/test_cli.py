"""`pns`: what it writes, what it says, and the code that it exits with."""

from __future__ import annotations

import json
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
import trimesh

from pns_common.onnx_model import DEFAULT_MODEL, bundled_models, load_model
from service import cli, formats
from service.example import part, part_glb
from service.gltf.container import read_glb
from service.soup_glb import soup_glb
from tests.networks import vertex_model_bytes

FACES = 1920
NAMES = ", ".join(bundled_models())


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def pns(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    """Run a command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments: str) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["pns", *arguments])
        with pytest.raises(SystemExit) as exit_:
            cli.main()
        captured = capfd.readouterr()
        return Outcome(exit_.value.code or 0, captured.out, captured.err)

    return run


@pytest.fixture
def part_file(tmp_path: Path) -> Path:
    path = tmp_path / "part.glb"
    path.write_bytes(part_glb())
    return path


def tree_of(path: Path) -> dict[str, Any]:
    return msgspec.json.decode(read_glb(path.read_bytes()).text)


def test_example_then_subdivide_as_the_readme_has_it(pns: Any, tmp_path: Path) -> None:
    assert pns("example", "part.glb").code == 0
    command = "subdivide part.glb -o part2.glb --levels 2 --report report.json"
    outcome = pns(*command.split())
    assert outcome.code == 0
    assert outcome.out == ""
    assert f"{16 * FACES:,} faces" in outcome.err
    report = json.loads((tmp_path / "report.json").read_text())
    assert report == tree_of(tmp_path / "part2.glb")["asset"]["extras"]["pns"]
    assert report["totals"]["faces"] == 16 * FACES


def test_options_reach_the_operator(pns: Any, tmp_path: Path, part_file: Path) -> None:
    arguments = "-o out.glb --budget 0.25 --reference-length 2.5 --diagnostics full --report r.json"
    assert pns("subdivide", str(part_file), *arguments.split()).code == 0
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["scheme"] == "pns"
    assert report["budget"] == 0.25
    assert report["meshes"][0]["reference_length"] == 2.5
    attributes = tree_of(tmp_path / "out.glb")["meshes"][0]["primitives"][0]["attributes"]
    assert "_PNS_RATIO" in attributes


@pytest.mark.parametrize("source", ["glb", "gltf", "obj", "ply", "stl", "off"])
@pytest.mark.parametrize("target", ["glb", "gltf", "obj", "ply", "stl", "off"])
def test_every_format_becomes_every_other(
    pns: Any, tmp_path: Path, part_file: Path, source: str, target: str
) -> None:
    if source == "gltf":
        pns("subdivide", "part.glb", "-o", "in.gltf", "--scheme", "loop")
        faces = 4 * FACES
    elif source == "glb":
        (tmp_path / "in.glb").write_bytes(part_file.read_bytes())
        faces = FACES
    else:
        (tmp_path / f"in.{source}").write_bytes(formats.write(part(), source))
        faces = FACES
    outcome = pns("subdivide", f"in.{source}", "-o", f"out.{target}", "--scheme", "loop")
    assert outcome.code == 0, outcome.err
    mesh = trimesh.load_scene(tmp_path / f"out.{target}", process=False).to_mesh()
    assert len(mesh.faces) == 4 * faces
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_watertight
    assert mesh.volume > 0


def test_what_a_format_cannot_hold_is_said_and_reported(
    pns: Any, tmp_path: Path, part_file: Path
) -> None:
    outcome = pns("subdivide", str(part_file), "-o", "out.stl", "--report", "r.json")
    changes = json.loads((tmp_path / "r.json").read_text())["changes"]
    lost = {change["what"].partition(" dropped")[0] for change in changes}
    assert lost == {"materials", "attribute NORMAL", "attribute TEXCOORD_0"}
    for name in lost:
        assert f"{name} dropped" in outcome.err
    outcome = pns("subdivide", str(part_file), "-o", "out.obj")
    assert "TEXCOORD_0" not in outcome.err
    outcome = pns("subdivide", "out.obj", "-o", "out.ply", "--diagnostics", "full")
    assert "texture coordinates dropped" in outcome.err
    assert "values at vertices dropped" in outcome.err


def test_every_loss_is_a_line_once(pns: Any, tmp_path: Path) -> None:
    text = "OFF\n5 2 0\n0 0 0\n1 0 0\n0 1 0\n9 9 9\n8 8 8\n3 0 1 2\n3 0 3 3\n"
    (tmp_path / "in.off").write_text(text)
    outcome = pns("subdivide", "in.off", "-o", "out.off", "--scheme", "loop")
    assert "1 × degenerate faces dropped\n" in outcome.err
    assert "2 × vertices dropped\n" in outcome.err
    assert "duplicate" not in outcome.err
    tree = tree_of_bytes(part_glb())
    indices = tree["accessors"][tree["meshes"][0]["primitives"][0]["indices"]]
    indices["count"] -= 3
    indices["byteOffset"] = 4
    (tmp_path / "in.glb").write_bytes(with_tree(part_glb(), tree))
    outcome = pns("subdivide", "in.glb", "-o", "out.glb", "--scheme", "loop")
    assert outcome.err.count("degenerate faces dropped") <= 1


@pytest.mark.parametrize("target", ["glb", "gltf", "ply", "stl"])
def test_what_float32_cannot_tell_apart_is_said(pns: Any, tmp_path: Path, target: str) -> None:
    far = "OFF\n3 1 0\n4500000 0 0\n4500000.2 0 0\n4500000 1 0\n3 0 1 2\n"
    (tmp_path / "far.off").write_text(far)
    assert "float32" in pns("subdivide", "far.off", "-o", f"out.{target}").err
    assert "float32" not in pns("subdivide", "far.off", "-o", "out.obj").err
    (tmp_path / "huge.off").write_text("OFF\n3 1 0\n1e40 0 0\n2e40 0 0\n0 1e40 0\n3 0 1 2\n")
    huge = pns("subdivide", "huge.off", "-o", f"huge.{target}")
    assert huge.code == 1
    assert "float32" in huge.err
    assert "Warning" not in huge.err
    assert not (tmp_path / f"huge.{target}").exists()


def test_texture_coordinates_keep_their_direction(pns: Any, tmp_path: Path) -> None:
    (tmp_path / "in.obj").write_bytes(formats.write(part(), "obj"))
    (tmp_path / "in.glb").write_bytes(soup_glb(part()))
    for source in ("in.obj", "in.glb"):
        for target in ("out.obj", "out.glb"):
            assert pns("subdivide", source, "-o", target, "--scheme", "loop").code == 0
            assert pns("subdivide", target, "-o", "last.obj", "--scheme", "loop").code == 0
            last = formats.read((tmp_path / "last.obj").read_bytes(), "obj")
            # The section's first point has v = 0 in the example, whatever way it went.
            low = last.vertices[np.isclose(last.uv[:, 1], 0, atol=1e-6)]
            np.testing.assert_allclose(np.hypot(low[:, 0], low[:, 2]), 0.40, atol=0.03)
            np.testing.assert_allclose(low[:, 1], -0.3, atol=0.06)


def test_nodes_are_flattened_into_world_space(pns: Any, tmp_path: Path) -> None:
    tree = tree_of_bytes(part_glb())
    tree["nodes"] = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 2**-0.5, 2**-0.5]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1]},
        {"mesh": 0},
    ]
    (tmp_path / "in.glb").write_bytes(with_tree(part_glb(), tree))
    assert pns("subdivide", "in.glb", "-o", "out.stl", "--scheme", "loop").code == 0
    one = pns("subdivide", "in.glb", "-o", "one.stl", "--scheme", "loop")
    assert "nodes joined" in one.err
    mesh = trimesh.load_mesh(tmp_path / "out.stl")
    # The scene shows the first root alone; the second instance is mirrored, not inside out.
    theirs = trimesh.load_scene(tmp_path / "in.glb", process=False).to_mesh()
    assert len(mesh.faces) == 2 * 4 * FACES
    np.testing.assert_allclose(mesh.bounds, theirs.bounds, atol=0.2)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(abs(theirs.volume), rel=0.1)


def tree_of_bytes(glb: bytes) -> dict[str, Any]:
    return msgspec.json.decode(read_glb(glb).text)


def with_tree(glb: bytes, tree: dict[str, Any]) -> bytes:
    from service.gltf.container import write_glb

    binary = read_glb(glb).binary
    assert binary is not None
    return write_glb(msgspec.json.encode(tree), [binary], [])


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ("subdivide missing.glb -o out.glb", 1, "missing.glb"),
        ("subdivide part.glb -o nowhere/out.glb", 1, "nowhere"),
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
def test_errors_are_one_line_and_leave_no_file(
    pns: Any, tmp_path: Path, part_file: Path, arguments: str, code: int, says: str
) -> None:
    (tmp_path / "broken.glb").write_bytes(b"no")
    (tmp_path / "broken.ply").write_bytes(b"no")
    tree = tree_of_bytes(part_glb())
    tree["buffers"][0]["uri"] = "part.bin"
    (tmp_path / "external.gltf").write_bytes(msgspec.json.encode(tree))
    before = set(tmp_path.iterdir())
    outcome = pns(*arguments.split())
    assert outcome.code == code, outcome.err
    assert says in outcome.err
    assert "Traceback" not in outcome.err
    if outcome.err.startswith("pns:"):
        assert outcome.err.count("\n") == 1
    assert set(tmp_path.iterdir()) == before


def test_a_failure_keeps_the_file_that_was_there(pns: Any, tmp_path: Path) -> None:
    (tmp_path / "out.glb").write_text("precious")
    (tmp_path / "broken.glb").write_bytes(b"no")
    assert pns("subdivide", "broken.glb", "-o", "out.glb").code == 1
    assert (tmp_path / "out.glb").read_text() == "precious"


def test_output_has_the_permissions_of_any_new_file(
    pns: Any, tmp_path: Path, part_file: Path
) -> None:
    pns("subdivide", str(part_file), "-o", "out.glb")
    (tmp_path / "plain").touch()
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("out.glb", "plain")}
    assert len(modes) == 1


@pytest.mark.parametrize(
    ("output", "report"),
    [("same.glb", "same.glb"), ("same.glb", "sub/../same.glb"), ("out.glb", "part.glb")],
)
def test_a_report_never_replaces_a_model(
    pns: Any, tmp_path: Path, part_file: Path, output: str, report: str
) -> None:
    (tmp_path / "sub").mkdir()
    outcome = pns("subdivide", "part.glb", "-o", output, "--report", report)
    assert outcome.code == 2
    assert report in outcome.err
    assert part_file.read_bytes() == part_glb()
    assert not (tmp_path / "same.glb").exists()


def test_a_missing_folder_is_named_with_the_file_that_was_asked_for(
    pns: Any, part_file: Path
) -> None:
    outcome = pns("subdivide", "part.glb", "-o", "nowhere/out.glb")
    assert outcome.err == "pns: nowhere/out.glb: No such file or directory\n"


@pytest.mark.parametrize(
    ("setting", "value"), [("PNS_FACES", "1000"), ("PNS_MEMORY", "1MiB"), ("PNS_JSON_ITEMS", "9")]
)
def test_a_limit_names_the_setting_that_raises_it(
    pns: Any, part_file: Path, monkeypatch: pytest.MonkeyPatch, setting: str, value: str
) -> None:
    monkeypatch.setenv(setting, value)
    outcome = pns("subdivide", "part.glb", "-o", "out.glb")
    assert outcome.code == 1
    assert f"{setting} allows more" in outcome.err


def test_a_file_may_replace_itself(pns: Any, part_file: Path) -> None:
    assert pns("subdivide", str(part_file), "-o", str(part_file)).code == 0
    assert tree_of(part_file)["asset"]["extras"]["pns"]["totals"]["faces"] == 4 * FACES


def test_a_fault_of_ours_is_a_traceback(pns: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fault() -> None:
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(cli, "app", fault)
    with pytest.raises(ZeroDivisionError):
        cli.main()


def test_a_model_is_a_name_or_a_file_and_the_name_wins(
    pns: Any, tmp_path: Path, part_file: Path
) -> None:
    (tmp_path / "paper").write_bytes(vertex_model_bytes(0))
    report = tmp_path / "r.json"
    for given, features in (("paper", "paper-5"), ("./paper", "signed-18")):
        command = f"subdivide part.glb -o out.glb --model {given} --report r.json"
        assert pns(*command.split()).code == 0
        found = json.loads(report.read_text())
        assert found["model"] == "paper"
        assert found["model_hash"] == load_model(given).hash
        assert load_model(given).card.features == features
    assert "vertex_rule" in found["levels"][0]
    loop = "subdivide part.glb -o out.glb --scheme loop --model ./paper --report r.json"
    assert pns(*loop.split()).code == 0
    assert json.loads(report.read_text())["model"] is None


def test_help_says_that_a_model_is_a_name_or_a_file(pns: Any) -> None:
    for command in ("subdivide", "serve", "info"):
        assert "NAME|FILE" in pns(command, "--help").out
    assert "./NAME" in pns("subdivide", "--help").out


def test_info_lists_models_and_shows_a_card(pns: Any) -> None:
    listed = pns("info").out.splitlines()
    assert set(bundled_models()) <= {line.partition(" ")[0] for line in listed}
    assert [line.partition(" ")[0] for line in listed if " * " in line] == [DEFAULT_MODEL]
    shown = pns("info", "paper").out
    model = load_model("paper")
    assert model.hash in shown
    assert str(model.card.budget) in shown
    assert model.card.features in shown
    percent = model.card.metrics["ridge-held-out"]["distance_near"]["percent"]
    assert f"{percent:.4g}" in shown


def test_settings_from_the_environment_hold_here_too(
    pns: Any, part_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PNS_FACES", "1000")
    outcome = pns("subdivide", str(part_file), "-o", "out.glb")
    assert outcome.code == 1
    assert "1000" in outcome.err


def test_neither_the_commands_nor_their_help_import_torch(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "import service.cli, service.server\n"
        "assert not {'numpy', 'onnxruntime', 'trimesh'} & set(sys.modules)\n"
        "import service.convert, service.jobs, service.example, service.model_info\n"
        "assert 'torch' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


def test_help_names_the_commands() -> None:
    executable = Path(sys.executable).with_name("pns")
    shown = subprocess.run([executable, "--help"], check=True, capture_output=True, text=True)
    for command in ("subdivide", "serve", "info", "example"):
        assert command in shown.stdout


def test_a_gltf_is_read_with_the_files_of_its_own_folder(pns: Any, tmp_path: Path) -> None:
    container = read_glb(part_glb())
    tree = msgspec.json.decode(container.text)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "part.bin").write_bytes(bytes(container.binary or b""))
    source = tmp_path / "in" / "part.gltf"
    for uri, code in (("part.bin", 0), ("other.bin", 1), ("../part.bin", 1)):
        tree["buffers"][0]["uri"] = uri
        source.write_bytes(msgspec.json.encode(tree))
        done = pns("subdivide", "in/part.gltf", "-o", "out.glb", "--scheme", "loop")
        assert done.code == code
        assert len(done.err.splitlines()) == 1
    assert "buffers" in tree_of(tmp_path / "out.glb")


@pytest.mark.parametrize("compress", ["draco", "meshopt"])
def test_compressed_files_are_written_and_read(pns: Any, part_file: Path, compress: str) -> None:
    assert pns("subdivide", "part.glb", "-o", "packed.glb", "--compress", compress).code == 0
    assert tree_of(part_file.with_name("packed.glb"))["extensionsRequired"]
    done = pns("subdivide", "packed.glb", "-o", "again.obj")
    assert done.code == 0
    assert f"{16 * FACES:,} faces" in done.err
