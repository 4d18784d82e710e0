"""Several inputs, streams, folders and URLs on the command line."""

import io
import sys

import pytest

from service import cli
from service.meshfiles import formats
from service.meshfiles.example import part
from tests.service.cli.trees import FACES, tree_of

LOOP = ("--scheme", "loop", "--levels", "1")


def test_several_files_go_to_a_folder_under_their_own_names(pns, tmp_path, part_file):
    (tmp_path / "a.obj").write_bytes(formats.write(part(), "obj"))
    (tmp_path / "b.vrm").write_bytes(part_file.read_bytes())
    (tmp_path / "broken.ply").write_bytes(
        b"ply\nformat ascii 1.0\nproperty something\nend_header\n"
    )
    (tmp_path / "out").mkdir()
    outcome = pns("subdivide", "a.obj", "broken.ply", "b.vrm", "-o", "out", *LOOP)
    assert outcome.code == 1
    assert "pns: broken.ply: line 3 of the PLY header" in outcome.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"a.obj", "b.vrm"}
    assert len(formats.read((tmp_path / "out" / "a.obj").read_bytes(), "obj").faces) == 4 * FACES
    assert tree_of(tmp_path / "out" / "b.vrm")["asset"]["extras"]["pns"]["totals"]["meshes"] == 1
    assert pns("subdivide", "a.obj", "b.vrm", "-o", "out", "--to", "stl", *LOOP).code == 0
    assert (tmp_path / "out" / "b.stl").exists()


def test_streams_are_read_and_written(tmp_path, monkeypatch, capfdbinary):
    class Stdin:
        buffer = io.BytesIO(formats.write(part(), "obj"))

    monkeypatch.setattr(sys, "stdin", Stdin)
    arguments = ["pns", "subdivide", "-", "-o", "-", "--from", "obj", "--to", "ply", *LOOP]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert not end.value.code
    written = capfdbinary.readouterr()
    assert len(formats.read(written.out, "ply").faces) == 4 * FACES
    assert b"stdout: 7,680 triangles" in written.err


def test_an_input_is_replaced_by_force(pns, tmp_path, part_file):
    before = part_file.read_bytes()
    assert pns("subdivide", "part.glb", "-o", "part.glb", "--force", *LOOP).code == 0
    assert part_file.read_bytes() != before
