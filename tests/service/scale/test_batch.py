"""Libraries of files: every file refined once, each fault its own file's, nothing half-written."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pns_common.model.file import BUNDLED
from service.cli import app
from service.errors import InvalidParameter, NoModelError
from service.meshfiles.convert import converted
from service.options import Limits, Options
from service.scale.batch import batch_work
from service.scale.engines.local import local
from service.scale.engines.work import nothing
from service.scale.job import Task, run
from tests.service.scale.jobs import misbehave
from tests.service.scale.libraries import (
    LOOP,
    TETRAHEDRON,
    batch_of,
    hashes,
    here,
    library,
    refined,
    rows,
)
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron
from tests.support.networks import breaking_off_bytes


def test_each_file_is_what_subdivide_makes_of_it(tmp_path):
    source = library(tmp_path / "in")
    assert refined(batch_of(tmp_path)).counts == {"done": 3}
    for name in ("a.obj", "b/c.obj", "d.glb"):
        kind = name[-3:]
        alone = converted((source / name).read_bytes(), kind, kind, LOOP, None, Limits())
        assert (tmp_path / "out" / name).read_bytes() == alone.content


def test_rows_say_what_was_done(tmp_path):
    library(tmp_path / "in")
    batch = batch_of(tmp_path)
    refined(batch)
    row = rows(batch)["a.obj"]
    data = (tmp_path / "out" / "a.obj").read_bytes()
    assert (row["status"], row["faces_in"], row["faces_out"]) == ("done", 4, 16)
    assert row["bytes_in"] == len(TETRAHEDRON)
    assert row["output_sha256"] == hashlib.sha256(data).hexdigest()


def test_rows_say_what_was_changed_or_lost(tmp_path):
    library(tmp_path / "in")
    (tmp_path / "in" / "bare.obj").write_bytes(TETRAHEDRON + b"f 1 2 2\nvn 0 0 1\n")
    batch = batch_of(tmp_path, to="obj")
    refined(batch)
    told = {name: row["changes"].splitlines() for name, row in rows(batch).items()}
    assert told["a.obj"] == []
    assert told["bare.obj"] == [
        "1 × vertex normals that no face names dropped",
        "1 × degenerate faces dropped: harmless, they have no area",
    ]
    lost = "1 × definitions of materials dropped: not written to OBJ files (/materials)"
    assert lost in told["d.glb"]


def test_what_is_done_is_not_done_again(tmp_path):
    source = library(tmp_path / "in")
    batch = batch_of(tmp_path)
    refined(batch)
    before = rows(batch)
    assert refined(batch).counts == {"skipped": 3}
    assert rows(batch) == before
    (source / "a.obj").write_bytes(TETRAHEDRON.replace(b"v 1 0 0", b"v 2 0 0"))
    (tmp_path / "out" / "d.glb").unlink()
    assert refined(batch).counts == {"skipped": 1, "done": 2}


def test_a_model_that_is_replaced_meanwhile_is_told(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    model = tmp_path / "m.onnx"
    shutil.copy(str(BUNDLED / "general.onnx"), model)

    def replaced(tasks):
        shutil.copy(str(BUNDLED / "paper.onnx"), model)
        return here(tasks)

    batch = batch_of(tmp_path, options=Options(), model=str(model))
    summary = refined(batch, replaced)
    assert summary.failures == [("no-model", 1)]
    assert not (tmp_path / "out" / "a.obj").exists()
    assert "not the model that this run began with" in rows(batch)["a.obj"]["detail"]


def test_a_result_that_other_options_replaced_is_made_again(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    batch = batch_of(tmp_path)
    refined(batch)
    expected = hashes(tmp_path / "out")
    refined(batch_of(tmp_path, options=Options(scheme="loop", levels=2)))
    assert refined(batch).counts == {"done": 1}
    assert hashes(tmp_path / "out") == expected
    assert refined(batch).counts == {"skipped": 1}


def test_a_result_that_any_other_run_replaced_is_made_again(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    batch = batch_of(tmp_path)
    refined(batch)
    expected = hashes(tmp_path / "out")
    # Of which this report's journal knows nothing.
    deeper = Options(scheme="loop", levels=2)
    refined(batch_of(tmp_path, options=deeper, report=tmp_path / "other.jsonl"))
    assert refined(replace(batch, dry=True)).counts == {"planned": 1}
    assert refined(batch).counts == {"done": 1}
    assert hashes(tmp_path / "out") == expected


def test_a_run_that_was_stopped_goes_on(tmp_path):
    library(tmp_path / "in")

    def stopped(tasks):
        yield [run(next(tasks))]
        raise KeyboardInterrupt

    batch = batch_of(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        refined(batch, stopped)
    assert len(rows(batch)) == 1
    assert refined(batch).counts == {"skipped": 1, "done": 2}
    assert len(rows(batch)) == 3


def test_two_runs_at_once_do_no_harm(tmp_path):
    library(tmp_path / "in", [f"{number}.obj" for number in range(20)])
    batch = batch_of(tmp_path)
    # In processes: the cap on a job's memory is that of a whole process.
    threads = [
        threading.Thread(target=refined, args=(batch, local(batch_work(60.0), 1))) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(rows(batch)) == 20
    assert len(set(hashes(tmp_path / "out").values())) == 1


@pytest.mark.parametrize(("content", "code"), [(b"glTF", "unreadable"), (b"", "unreadable")])
def test_a_bad_file_costs_itself_alone(tmp_path, content, code):
    library(tmp_path / "in")
    (tmp_path / "in" / "bad.glb").write_bytes(content)
    batch = batch_of(tmp_path)
    summary = refined(batch)
    assert summary.counts == {"done": 3, "failed": 1}
    assert summary.failures == [(code, 1)]
    assert rows(batch)["bad.glb"]["code"] == code
    assert not (tmp_path / "out" / "bad.glb").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="names there are text")
def test_a_name_that_is_no_text_costs_its_file_alone(tmp_path):
    source = library(tmp_path / "in", ["a.obj"])
    Path(os.fsdecode(os.fsencode(source) + b"/b\xff.obj")).write_bytes(TETRAHEDRON)
    batch = batch_of(tmp_path)
    assert refined(batch).counts == {"done": 1, "failed": 1}
    assert rows(batch)["b\\udcff.obj"]["code"] == "unreadable-name"


def test_limits_hold_for_each_file(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    batch = batch_of(tmp_path, limits=Limits(max_faces=15))
    assert refined(batch).failures == [("limit-exceeded", 1)]


def test_a_fault_of_ours_is_told_and_the_rest_goes_on(tmp_path, monkeypatch):
    library(tmp_path / "in", ["a.obj"])

    def broken(*_):
        raise ZeroDivisionError("ours")

    monkeypatch.setattr("service.meshfiles.formats.read_polygons", broken)
    batch = batch_of(tmp_path)
    assert refined(batch).failures == [("internal-error", 1)]
    assert "ZeroDivisionError: ours" in rows(batch)["a.obj"]["detail"]


def test_what_a_model_cannot_do_is_the_row_of_its_file(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    breaks = tmp_path / "breaks.onnx"
    breaks.write_bytes(breaking_off_bytes())
    batch = batch_of(tmp_path, options=Options(), model=str(breaks))
    assert refined(batch).failures == [("unrefinable", 1)]
    assert "runs to its end" in rows(batch)["a.obj"]["detail"]


def test_a_model_that_is_gone_is_told_before_the_work_and_by_each_file(tmp_path):
    source = library(tmp_path / "in", ["a.obj"])
    gone = str(tmp_path / "gone.onnx")
    with pytest.raises(NoModelError, match="gone"):
        refined(batch_of(tmp_path, options=Options(), model=gone))
    task = Task(
        str(source / "a.obj"), str(tmp_path / "o.obj"), "obj", "obj", Options(), gone, Limits()
    )
    assert (run(task).status, run(task).code) == ("failed", "no-model")


def test_memory_that_runs_out_costs_its_file_alone(tmp_path, monkeypatch):
    library(tmp_path / "in", ["a.obj"])

    def takes_too_much(*_):
        raise MemoryError

    monkeypatch.setattr("service.meshfiles.formats.read_polygons", takes_too_much)
    batch = batch_of(tmp_path)
    assert refined(batch).failures == [("limit-exceeded", 1)]
    assert f"{Limits().max_memory_bytes} bytes" in rows(batch)["a.obj"]["detail"]


def test_workers_that_die_or_hang_cost_their_file_alone(tmp_path):
    library(tmp_path / "in", ["a.obj", "dies.obj", "dies-once.obj", "hangs.obj", "z.obj"])
    batch = batch_of(tmp_path)
    summary = refined(batch, local(replace(batch_work(1.0, misbehave), prepare=nothing), 2))
    by_name = rows(batch)
    assert summary.counts == {"done": 3, "failed": 2}
    assert (by_name["dies.obj"]["code"], by_name["dies.obj"]["attempts"]) == ("worker-died", 2)
    assert (by_name["hangs.obj"]["code"], by_name["hangs.obj"]["attempts"]) == ("job-timeout", 2)
    assert by_name["dies-once.obj"]["attempts"] == 2


def test_two_sources_of_one_result_are_told(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    (tmp_path / "in" / "a.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    summary = refined(batch_of(tmp_path, to="ply"))
    assert summary.counts == {"done": 1, "failed": 1}
    assert summary.failures == [("output-taken", 1)]


@pytest.mark.parametrize("destination", ["in", "link", "other/../in"])
def test_a_library_is_not_replaced_by_its_results(tmp_path, destination):
    source = library(tmp_path / "in", ["a.obj"])
    (tmp_path / "link").symlink_to(source)
    (tmp_path / "other").mkdir()
    folder = str(tmp_path / destination)
    with pytest.raises(InvalidParameter, match="results need a folder of their own"):
        refined(batch_of(tmp_path, destination=folder))
    for one in (source / "a.obj", source / "*.obj"):
        summary = refined(batch_of(tmp_path, one, destination=folder))
        assert summary.failures == [("output-is-source", 1)]
    assert (source / "a.obj").read_bytes() == TETRAHEDRON


def test_files_that_a_document_names_are_part_of_it(tmp_path):
    tree, binary = files.document([octahedron()])
    tree["buffers"][0]["uri"] = "parts/a%20b.bin"
    tree["images"] = [{"uri": "a.png"}]
    source, buffer = tmp_path / "in" / "a.gltf", tmp_path / "in" / "parts" / "a b.bin"
    buffer.parent.mkdir(parents=True)
    source.write_text(json.dumps(tree))
    buffer.write_bytes(binary)
    batch = batch_of(tmp_path)
    assert refined(batch).counts == {"done": 1}
    assert refined(batch).counts == {"skipped": 1}
    buffer.write_bytes(bytes(binary).replace(np.float32(1).tobytes(), np.float32(2).tobytes(), 1))
    assert refined(batch).counts == {"done": 1}
    (tmp_path / "in" / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert refined(batch_of(tmp_path, dry=True)).counts == {"planned": 1}
    assert refined(batch).counts == {"done": 1}
    assert refined(batch).counts == {"skipped": 1}


def test_materials_and_textures_lie_beside_the_result_too(tmp_path):
    mtl = b"newmtl a\nmap_Kd tex/t.png\n"
    named = {"a.obj": b"mtllib a.mtl\nusemtl a\n" + TETRAHEDRON, "a.mtl": mtl, "tex/t.png": b"t"}
    for name, content in named.items():
        path = tmp_path / "in" / "b" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    batch, out = batch_of(tmp_path), tmp_path / "out" / "b"
    assert refined(batch).counts == {"done": 1}
    assert (out / "a.mtl").read_bytes() == mtl
    assert (out / "tex" / "t.png").read_bytes() == b"t"
    assert rows(batch)["a.obj"]["changes"] == "2 × copied beside the result: a.mtl, tex/t.png"
    # What an earlier run has written follows its source.
    (tmp_path / "in" / "b" / "a.mtl").write_bytes(mtl + b"Kd 1 0 0\n")
    assert refined(batch).counts == {"done": 1}
    assert (out / "a.mtl").read_bytes() == mtl + b"Kd 1 0 0\n"


def test_a_source_that_is_gone_holds_its_result_no_longer(tmp_path):
    source = library(tmp_path / "in", ["a.obj"])
    batch = batch_of(tmp_path, to="ply")
    refined(batch)
    (source / "a.obj").unlink()
    (source / "a.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    assert refined(batch).counts == {"done": 1}
    assert list(rows(batch)) == ["a.off"]
    (source / "a.obj").write_bytes(TETRAHEDRON)
    assert refined(batch).failures == [("output-taken", 1)]


def test_a_dry_run_writes_nothing_but_its_report(tmp_path):
    library(tmp_path / "in")
    planned = refined(batch_of(tmp_path, dry=True))
    assert planned.counts == {"planned": 3}
    assert not (tmp_path / "out").exists()
    assert planned.faces["planned"] == refined(batch_of(tmp_path)).faces["done"] > 0


@pytest.mark.parametrize("goal", [{"tolerance": "3%"}, {"angle": 25.0}, {"max_faces": 2000}])
def test_a_dry_run_of_a_goal_counts_what_the_run_writes(tmp_path, goal):
    library(tmp_path / "in")
    options = replace(LOOP, crease="angle:30", **goal)
    planned = refined(batch_of(tmp_path, options=options, dry=True))
    assert planned.counts == {"planned": 3}
    assert not (tmp_path / "out").exists()
    done = refined(batch_of(tmp_path, options=options))
    assert planned.faces["planned"] == done.faces["done"] > 16


@pytest.mark.parametrize(
    "changes",
    [
        {"source": "/no/such/folder"},
        {"report": Path("/no/such/folder/report.jsonl")},
        {"report": Path("report.txt")},
        {"to": "fbx"},
        {"source": "{tmp_path}/in/*.stl"},
        {"source": "{tmp_path}/empty"},
        {"destination": "{tmp_path}/in/a.obj/out"},
        {"destination": "{tmp_path}/in/a.obj"},
    ],
)
def test_what_cannot_be_used_is_told_before_anything_runs(tmp_path, changes):
    library(tmp_path / "in")
    (tmp_path / "empty").mkdir()
    given = {
        name: value.format(tmp_path=tmp_path) if isinstance(value, str) else value
        for name, value in changes.items()
    }
    with pytest.raises(InvalidParameter):
        refined(batch_of(tmp_path, **given))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "in"]


def test_the_command_says_what_failed_and_ends_with_one(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    library(tmp_path / "in", ["a.obj"])
    (tmp_path / "in" / "bad.glb").write_bytes(b"no")
    monkeypatch.chdir(tmp_path)
    arguments = ["batch", "in", "out", "--scheme", "loop", "--report", "r.jsonl", "--workers", "1"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 1
    assert "a row for each file: r.jsonl" in done.stderr
    assert (tmp_path / "out" / "a.obj").is_file()
    elsewhere = [*arguments[:2], "elsewhere", *arguments[3:], "--dry-run"]
    planned = CliRunner().invoke(app, elsewhere)
    assert "in/a.obj -> " in planned.stderr
    assert "a row for each file" not in planned.stderr


def test_a_report_that_is_a_folder_is_told_before_the_work(tmp_path):
    (tmp_path / "r.jsonl").mkdir()
    with pytest.raises(InvalidParameter, match=r"r\.jsonl: it is a folder"):
        refined(batch_of(tmp_path, library(tmp_path / "in"), report=tmp_path / "r.jsonl"))
    assert not (tmp_path / "out").exists()


def test_a_worker_starts_without_what_only_a_driver_needs():
    code = (
        "import sys; from service.scale.job import read_libraries; read_libraries()\n"
        "print({'onnxruntime', 'rich', 'typer'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True)
    assert done.stdout == b"set()\n"
