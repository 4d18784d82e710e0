"""What a large mesh's work refuses, and what it leaves alone."""

import errno
import io
import os
import struct
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from pns_common import Mesh
from pns_common.pieces.tally import Summed
from service.cli import app
from service.errors import (
    InvalidParameter,
    LimitError,
    UnreadableError,
    UnrefinableError,
    WorkerDied,
)
from service.options import Options
from service.scale.large import plan
from service.scale.large.arrays import append, let_go, new_array, open_mesh, reserve
from service.scale.large.plan import Large, work_folder
from service.scale.large.run import run_large
from service.scale.large.target import new_ply
from tests.service.scale.large.parts import here
from tests.support.meshes import bent, grid

LOOP = Options(scheme="loop")


@pytest.fixture
def source(tmp_path):
    folder, mesh = tmp_path / "in", Mesh(*grid(5, bent))
    folder.mkdir()
    np.save(folder / "positions.npy", mesh.vertices)
    np.save(folder / "faces.npy", mesh.faces)
    return folder


def refined(source, output):
    large = Large(source, output, LOOP, 2**31, 2)
    run_large(large, here, Console(file=io.StringIO()))


def header(text):
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK\x03\x04",
        header("("),
        header("'''"),
        header("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 3)}"),
        *(
            header(f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, 3)}}")
            for count in (10**9, 2**62, (2**64 - 1) // 3 + 1, 10**30)
        ),
    ],
)
def test_a_header_that_promises_anything_is_told(source, content):
    (source / "positions.npy").write_bytes(content + bytes(72))
    with pytest.raises(UnreadableError, match="positions"):
        open_mesh(source)


def test_a_folder_that_is_somebodys_is_left_alone(tmp_path, source):
    theirs = tmp_path / "out.work" / "thesis.tex"
    theirs.parent.mkdir()
    theirs.write_text("years of work")
    with pytest.raises(InvalidParameter, match="holds something else"):
        refined(source, tmp_path / "out")
    assert [file.read_text() for file in theirs.parent.iterdir()] == ["years of work"]


def test_a_missing_input_leaves_nothing(tmp_path):
    with pytest.raises(InvalidParameter, match="no such file"):
        refined(tmp_path / "no", tmp_path / "out")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("names", [("none/out",), ("out", "--report", "none/r.json")])
def test_a_folder_that_is_missing_is_told_before_the_work(tmp_path, source, names, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["large", str(source), *names, "--scheme", "loop"])
    assert isinstance(done.exception, InvalidParameter)
    assert str(done.exception) == "none: there is no such folder"
    assert [file.name for file in tmp_path.iterdir()] == ["in"]


def test_a_worker_that_outlived_another_plan_writes_nothing_into_this_one(tmp_path, source):
    def plan(levels):
        return Large(source, tmp_path / "out", Options(scheme="loop", levels=levels), 2**31, 2)

    def stopped(levels):
        with work_folder(plan(levels), None) as work:
            folders.append(work)
            raise KeyboardInterrupt

    folders = []
    for levels in (1, 2, 2):
        with pytest.raises(KeyboardInterrupt):
            stopped(levels)
    assert folders[0] != folders[1]
    assert folders[1] == folders[2]
    assert not folders[0].exists()


def test_parts_that_kept_other_lines_are_not_gone_on_from(tmp_path, source, monkeypatch):
    """Those of version 1 knew no edged meshes; that shows neither in options nor in a model."""
    large = Large(source, tmp_path / "out", Options(scheme="loop", crease="lines"), 2**31, 2)

    def stopped():
        with work_folder(large, None) as work:
            folders.append(work)
            raise KeyboardInterrupt

    folders = []
    for version in (1, plan.VERSION):
        monkeypatch.setattr(plan, "VERSION", version)
        with pytest.raises(KeyboardInterrupt):
            stopped()
    assert folders[0] != folders[1]


@pytest.mark.parametrize("crease", [(0, 24), (0, 25), (-1, 0), (3, 3)])
def test_a_crease_that_is_no_edge_is_told(tmp_path, source, crease):
    np.save(source / "creases.npy", np.array([(0, 1), crease, (1, 2)]))
    with pytest.raises(UnrefinableError, match=r"crease 1: .*no edge"):
        refined(source, tmp_path / "out")


def test_each_edge_may_be_a_crease(tmp_path, source):
    faces = np.load(source / "faces.npy")
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [2, 1]], faces[:, [0, 2]]])
    np.save(source / "creases.npy", np.ascontiguousarray(edges))
    refined(source, tmp_path / "out")
    assert (tmp_path / "out" / "positions.npy").exists()


def test_a_ply_of_more_vertices_than_it_can_number_is_refused(tmp_path):
    with pytest.raises(LimitError, match="4294967296 vertices"):
        new_ply(tmp_path / "out.ply", 2**32, 1)
    assert not any(tmp_path.iterdir())


def test_a_disk_that_fills_while_room_is_taken_is_empty_again(tmp_path, monkeypatch):
    def fills(descriptor, _, size):
        os.write(descriptor, bytes(size))
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", fills, raising=False)
    (tmp_path / "file").touch()
    with pytest.raises(LimitError, match="GB are needed"):
        reserve(tmp_path / "file", 1000)
    assert (tmp_path / "file").stat().st_size == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_disk_that_is_full_is_told_with_the_file_that_it_has_no_room_for(tmp_path):
    (tmp_path / "rows").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left") as refusal:
        append(tmp_path / "rows", np.zeros((5, 3)))
    assert refusal.value.filename == f"{tmp_path}/rows"


def test_a_disk_that_breaks_is_not_called_full(tmp_path, monkeypatch):
    def breaks(*_):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("os.posix_fallocate", breaks, raising=False)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="Input/output") as refusal:
        reserve(tmp_path / "file", 1000)
    assert refusal.value.errno == errno.EIO


def test_room_that_is_not_there_is_not_asked_for(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("os.posix_fallocate", lambda *size: asked.append(size), raising=False)
    (tmp_path / "file").touch()
    with pytest.raises(LimitError, match="GB are needed"):
        reserve(tmp_path / "file", 2**60)
    assert not asked


def test_room_is_taken_where_there_is_no_call_for_it(tmp_path, monkeypatch):
    monkeypatch.delattr("os.posix_fallocate")
    (tmp_path / "file").touch()
    reserve(tmp_path / "file", 1000)
    assert (tmp_path / "file").stat().st_size == 1000


def test_sums_of_large_parts_are_exact():
    # As many steps as 2²³ + 2¹³ numbers of 1.
    values = np.full(2**13 + 8, 1024.0)
    assert Summed.of(values).steps == 2**50 * len(values)


def test_a_folder_that_holds_a_stranger_s_file_is_not_replaced(source, tmp_path):
    output = tmp_path / "out"
    refined(source, output)
    refined(source, output)
    (output / "notes.txt").write_text("mine")
    with pytest.raises(InvalidParameter, match="something else: notes"):
        refined(source, output)
    assert (output / "notes.txt").read_text() == "mine"


def test_a_folder_that_came_meanwhile_is_not_replaced_and_the_work_stays(source, tmp_path):
    theirs = tmp_path / "out" / "notes.txt"

    def meanwhile(tasks):
        theirs.parent.mkdir(exist_ok=True)
        theirs.write_text("mine")
        return here(tasks)

    def never(_):
        raise AssertionError("all parts are done")

    large = Large(source, tmp_path / "out", LOOP, 2**31, 2)
    with pytest.raises(FileExistsError, match="something else: notes") as refusal:
        run_large(large, meanwhile, Console(file=io.StringIO()))
    assert refusal.value.filename == str(tmp_path / "out")
    assert theirs.read_text() == "mine"
    theirs.parent.rename(tmp_path / "elsewhere")
    run_large(large, lambda tasks: never(tasks) if list(tasks) else iter(()), Console())
    assert (tmp_path / "out" / "mesh.json").exists()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.glb", b""),
        ("a.glb", b"glTF"),
        ("a.glb", b"glTF" + struct.pack("<IIII", 2, 0, 200_000, 0x4E4F534A) + b"[" * 200_000),
        ("a.glb", b"glTF" + struct.pack("<IIII", 2, 0, 16, 0x4E4F534A) + b'{"meshes":[ 1 ]}'),
        ("a.obj", b"v 0 0 0\nf 1 1 99999999999999999999\n"),
        ("a.obj", b"v 0 0 " + b"0" * (1 << 24)),
        ("a.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty\n"
         b"element face 1\nend_header\n"),
    ],
)  # fmt: skip
def test_a_file_that_is_none_is_refused_by_name(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableError, match=name):
        refined(tmp_path / name, tmp_path / "out")
    assert [file.name for file in tmp_path.iterdir() if file.name != "in"] == [name]


def test_what_was_refused_leaves_no_work(source, tmp_path):
    np.save(source / "faces.npy", np.array([[0, 1, 99]], dtype="<i4"))
    with pytest.raises(UnrefinableError):
        refined(source, tmp_path / "out")
    assert [file.name for file in tmp_path.iterdir()] == ["in"]


def test_what_workers_died_of_can_be_gone_on_with(source, tmp_path):
    def dies(_):
        raise WorkerDied("part 0: its worker ended")

    with pytest.raises(WorkerDied):
        run_large(
            Large(source, tmp_path / "out", LOOP, 2**31, 2), dies, Console(file=io.StringIO())
        )
    assert list((tmp_path / "out.work").glob("*/plan.json"))


def test_a_memory_that_is_none_is_told_by_its_option(source, tmp_path):
    done = CliRunner().invoke(app, ["large", str(source), str(tmp_path / "out"), "--memory", "abc"])
    assert done.exit_code == 2
    assert "--memory" in done.output
    assert "4GiB" in done.output


def test_a_part_whose_halo_is_too_large_is_told_with_the_vertex_that_makes_it_so(tmp_path):
    count = 2000
    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rim = np.stack([np.cos(turn), np.sin(turn), np.sin(7 * turn)], axis=1)
    rows = np.arange(count)
    (tmp_path / "in").mkdir()
    np.save(tmp_path / "in" / "positions.npy", np.concatenate([rim, [[0.0, 0, 0]]]))
    faces = np.stack([np.full(count, count), rows, (rows + 1) % count], axis=1)
    np.save(tmp_path / "in" / "faces.npy", faces)
    deep = Options(scheme="loop", levels=6)
    large = Large(tmp_path / "in", tmp_path / "out", deep, 330 * 2**20)
    with pytest.raises(LimitError, match=r"with the halo .* 2,000, .* vertex 2000 alone .* 2,000"):
        run_large(large, here, Console(file=io.StringIO()))
    assert [file.name for file in tmp_path.iterdir()] == ["in"]


def resident_of_files():
    lines = Path("/proc/self/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("RssFile"))
    return int(line.split()[1]) * 1024


def test_pages_that_are_let_go_are_not_resident_and_keep_what_was_written(tmp_path):
    array = new_array(tmp_path / "a.npy", (1 << 22,), "<i8")
    array[:] = np.arange(1 << 22)
    before = resident_of_files()
    let_go(array, np.zeros(3))
    assert before - resident_of_files() > 24 * 2**20
    assert (array == np.arange(1 << 22)).all()
    assert (np.load(tmp_path / "a.npy") == np.arange(1 << 22)).all()
