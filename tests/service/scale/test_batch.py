"""Libraries of files: every file refined once, each fault its own file's, nothing half-written."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import threading
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pns_common.files import replacing
from pns_common.model.file import BUNDLED
from service.cli import app
from service.errors import InvalidParameter, NoModelError
from service.meshfiles.convert import converted
from service.options import Limits, Options
from service.scale.batch import batch_work
from service.scale.engines.local import local
from service.scale.engines.work import nothing
from service.scale.job import Known, Row, Task, run
from service.scale.journal import Journal, open_journal
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

TRIANGLE = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
DEEPER = Options(scheme="loop", levels=2)


@pytest.fixture
def one(tmp_path):
    """A library of one file."""
    return library(tmp_path / "in", ["a.obj"]) / "a.obj"


def counts(batch):
    return refined(batch).counts


def test_each_file_is_what_subdivide_makes_of_it_and_its_row_says_so(tmp_path):
    source = library(tmp_path / "in")
    (source / "bare.obj").write_bytes(TETRAHEDRON + b"f 1 2 2\nvn 0 0 1\n")
    batch = batch_of(tmp_path)
    assert counts(batch) == {"done": 4}
    for name in ("a.obj", "b/c.obj", "d.glb"):
        data, kind = (source / name).read_bytes(), name[-3:]
        alone = converted(data, kind, kind, LOOP, None, Limits()).content
        assert (tmp_path / "out" / name).read_bytes() == alone
        row = rows(batch)[name.rpartition("/")[2]]
        assert (row["status"], row["bytes_in"]) == ("done", len(data))
        assert row["output_sha256"] == hashlib.sha256(alone).hexdigest()
    assert (rows(batch)["a.obj"]["faces_in"], rows(batch)["a.obj"]["faces_out"]) == (4, 16)
    refined(batch_of(tmp_path, to="obj"))
    told = {name: row["changes"].splitlines() for name, row in rows(batch).items()}
    assert told["a.obj"] == []
    assert told["bare.obj"] == [
        "1 × vertex normals that no face names dropped",
        "1 × degenerate faces dropped: harmless, they have no area",
    ]
    lost = "1 × definitions of materials dropped: not written to OBJ files (/materials)"
    assert lost in told["d.glb"]


# Runs one after another


def test_what_is_done_is_not_done_again(tmp_path):
    source = library(tmp_path / "in")
    batch = batch_of(tmp_path)

    def stopped(tasks):
        yield [run(next(tasks))]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refined(batch, stopped)
    assert len(rows(batch)) == 1
    assert counts(batch) == {"skipped": 1, "done": 2}
    before = rows(batch)
    assert len(before) == 3
    assert counts(batch) == {"skipped": 3}
    assert rows(batch) == before
    (source / "a.obj").write_bytes(TETRAHEDRON.replace(b"v 1 0 0", b"v 2 0 0"))
    (tmp_path / "out" / "d.glb").unlink()
    assert counts(batch) == {"skipped": 1, "done": 2}


@pytest.mark.parametrize("report", ["report.jsonl", "other.jsonl"])
def test_a_result_that_another_run_replaced_is_made_again(tmp_path, one, report):
    """By other options, or with a report of which this one's journal knows nothing."""
    batch = batch_of(tmp_path)
    refined(batch)
    expected = hashes(tmp_path / "out")
    refined(batch_of(tmp_path, options=DEEPER, report=tmp_path / report))
    assert counts(replace(batch, dry=True)) == {"planned": 1}
    assert counts(batch) == {"done": 1}
    assert hashes(tmp_path / "out") == expected
    assert counts(batch) == {"skipped": 1}


def test_a_source_that_is_gone_holds_its_result_no_longer(tmp_path, one):
    batch = batch_of(tmp_path, to="ply")
    refined(batch)
    one.unlink()
    one.with_suffix(".off").write_bytes(TRIANGLE)
    assert counts(batch) == {"done": 1}
    assert list(rows(batch)) == ["a.off"]
    # Two sources of one result.
    one.write_bytes(TETRAHEDRON)
    assert refined(batch).failures == [("output-taken", 1)]


def test_files_that_a_document_names_are_part_of_it(tmp_path):
    tree, binary = files.document([octahedron()])
    tree["buffers"][0]["uri"] = "parts/a%20b.bin"
    tree["images"] = [{"uri": "a.png"}]
    source, buffer = tmp_path / "in" / "a.gltf", tmp_path / "in" / "parts" / "a b.bin"
    buffer.parent.mkdir(parents=True)
    source.write_text(json.dumps(tree))
    buffer.write_bytes(binary)
    batch = batch_of(tmp_path)
    assert [counts(batch) for _ in range(2)] == [{"done": 1}, {"skipped": 1}]
    buffer.write_bytes(bytes(binary).replace(np.float32(1).tobytes(), np.float32(2).tobytes(), 1))
    assert counts(batch) == {"done": 1}
    (tmp_path / "in" / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert counts(batch_of(tmp_path, dry=True)) == {"planned": 1}
    assert [counts(batch) for _ in range(2)] == [{"done": 1}, {"skipped": 1}]


def test_materials_and_textures_lie_beside_the_result_too(tmp_path):
    mtl = b"newmtl a\nmap_Kd tex/t.png\n"
    named = {"a.obj": b"mtllib a.mtl\nusemtl a\n" + TETRAHEDRON, "a.mtl": mtl, "tex/t.png": b"t"}
    for name, content in named.items():
        path = tmp_path / "in" / "b" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    batch, out = batch_of(tmp_path), tmp_path / "out" / "b"
    assert counts(batch) == {"done": 1}
    assert (out / "a.mtl").read_bytes() == mtl
    assert (out / "tex" / "t.png").read_bytes() == b"t"
    assert rows(batch)["a.obj"]["changes"] == "2 × copied beside the result: a.mtl, tex/t.png"
    # What an earlier run has written follows its source.
    (tmp_path / "in" / "b" / "a.mtl").write_bytes(mtl + b"Kd 1 0 0\n")
    assert counts(batch) == {"done": 1}
    assert (out / "a.mtl").read_bytes() == mtl + b"Kd 1 0 0\n"


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


def test_two_runs_at_once_do_no_harm(tmp_path):
    library(tmp_path / "in", [f"{number}.obj" for number in range(12)])
    batch = batch_of(tmp_path)
    # In processes: the cap on a job's memory is that of a whole process.
    work = replace(batch_work(60.0), prepare=nothing)
    threads = [threading.Thread(target=refined, args=(batch, local(work, 1))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(rows(batch)) == 12
    assert len(set(hashes(tmp_path / "out").values())) == 1


# Faults


def broken(error):
    def fails(*_):
        raise error

    return fails


@pytest.mark.parametrize(
    ("error", "limits", "code", "says"),
    [
        (None, Limits(max_faces=15), "limit-exceeded", ""),
        (MemoryError(), Limits(), "limit-exceeded", f"{Limits().max_memory_bytes} bytes"),
        (ZeroDivisionError("ours"), Limits(), "internal-error", "ZeroDivisionError: ours"),
    ],
    ids=["a limit", "memory", "a fault of ours"],
)
def test_what_goes_wrong_is_the_row_of_its_file(
    tmp_path, one, monkeypatch, error, limits, code, says
):
    if error is not None:
        monkeypatch.setattr("service.meshfiles.formats.read_polygons", broken(error))
    batch = batch_of(tmp_path, limits=limits)
    assert refined(batch).failures == [(code, 1)]
    assert says in rows(batch)["a.obj"]["detail"]


@pytest.mark.parametrize("content", [b"glTF", b""])
def test_a_bad_file_costs_itself_alone(tmp_path, content):
    library(tmp_path / "in")
    (tmp_path / "in" / "bad.glb").write_bytes(content)
    batch = batch_of(tmp_path)
    assert counts(batch) == {"done": 3, "failed": 1}
    assert rows(batch)["bad.glb"]["code"] == "unreadable"
    assert not (tmp_path / "out" / "bad.glb").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="names there are text")
def test_a_name_that_is_no_text_costs_its_file_alone(tmp_path, one):
    Path(os.fsdecode(os.fsencode(one.parent) + b"/b\xff.obj")).write_bytes(TETRAHEDRON)
    batch = batch_of(tmp_path)
    assert counts(batch) == {"done": 1, "failed": 1}
    assert rows(batch)["b\\udcff.obj"]["code"] == "unreadable-name"


def test_models_that_are_gone_replaced_or_break_off_are_told(tmp_path, one):
    model, gone = tmp_path / "m.onnx", str(tmp_path / "gone.onnx")
    with pytest.raises(NoModelError, match="gone"):
        refined(batch_of(tmp_path, options=Options(), model=gone))
    row = run(Task(str(one), str(tmp_path / "o.obj"), "obj", "obj", Options(), gone, Limits()))
    assert (row.status, row.code) == ("failed", "no-model")

    def replaced(tasks):
        shutil.copy(str(BUNDLED / "paper.onnx"), model)
        return here(tasks)

    shutil.copy(str(BUNDLED / "general.onnx"), model)
    batch = batch_of(tmp_path, options=Options(), model=str(model))
    assert refined(batch, replaced).failures == [("no-model", 1)]
    assert not (tmp_path / "out" / "a.obj").exists()
    assert "not the model that this run began with" in rows(batch)["a.obj"]["detail"]
    breaks = tmp_path / "breaks.onnx"
    breaks.write_bytes(breaking_off_bytes())
    batch = batch_of(tmp_path, options=Options(), model=str(breaks))
    assert refined(batch).failures == [("unrefinable", 1)]
    assert "runs to its end" in rows(batch)["a.obj"]["detail"]


def test_workers_that_die_or_hang_cost_their_file_alone(tmp_path):
    library(tmp_path / "in", ["a.obj", "dies.obj", "dies-once.obj", "hangs.obj", "z.obj"])
    batch = batch_of(tmp_path)
    summary = refined(batch, local(replace(batch_work(1.0, misbehave), prepare=nothing), 2))
    assert summary.counts == {"done": 3, "failed": 2}
    told = {name: (row["code"], row["attempts"]) for name, row in rows(batch).items()}
    assert (told["dies.obj"], told["hangs.obj"]) == (("worker-died", 2), ("job-timeout", 2))
    assert told["dies-once.obj"][1] == 2


@pytest.mark.parametrize("destination", ["in", "link", "other/../in"])
def test_a_library_is_not_replaced_by_its_results(tmp_path, one, destination):
    (tmp_path / "link").symlink_to(one.parent)
    (tmp_path / "other").mkdir()
    folder = str(tmp_path / destination)
    with pytest.raises(InvalidParameter, match="results need a folder of their own"):
        refined(batch_of(tmp_path, destination=folder))
    for source in (one, one.with_name("*.obj")):
        summary = refined(batch_of(tmp_path, source, destination=folder))
        assert summary.failures == [("output-is-source", 1)]
    assert one.read_bytes() == TETRAHEDRON


@pytest.mark.parametrize(
    "changes",
    [
        *({"source": source} for source in ("/no/such/folder", "{}/in/*.stl", "{}/empty")),
        {"report": Path("/no/such/folder/report.jsonl")},
        {"report": Path("report.txt")},
        {"to": "fbx"},
        *({"destination": f"{{}}/in/a.obj{more}"} for more in ("", "/out")),
    ],
)
def test_what_cannot_be_used_is_told_before_anything_runs(tmp_path, one, changes):
    (tmp_path / "empty").mkdir()
    given = {
        name: value.format(tmp_path) if isinstance(value, str) else value
        for name, value in changes.items()
    }
    with pytest.raises(InvalidParameter):
        refined(batch_of(tmp_path, **given))
    (tmp_path / "r.jsonl").mkdir()
    with pytest.raises(InvalidParameter, match=r"r\.jsonl: it is a folder"):
        refined(batch_of(tmp_path, report=tmp_path / "r.jsonl"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "in", "r.jsonl"]


def test_the_command_says_what_failed_and_ends_with_one(tmp_path, one, monkeypatch):
    from typer.testing import CliRunner

    one.with_name("bad.glb").write_bytes(b"no")
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


def test_a_worker_starts_without_what_only_a_driver_needs():
    code = (
        "import sys; from service.scale.job import read_libraries; read_libraries()\n"
        "print({'onnxruntime', 'rich', 'typer'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True)
    assert done.stdout == b"set()\n"


# The journal: what is known of a library outlives a run, and several runs at once


def done(path, *, output="x", size=""):
    return Row(path, output + size, "done", input_sha256="1", output_sha256="2")


def test_a_journal_knows_only_what_was_done_by_the_same_work(tmp_path):
    journal = Journal(tmp_path / "r.jsonl", "one")
    journal.put([done("a"), Row("b", "y", "failed", input_sha256="2")])
    assert (journal.known("a"), journal.known("b")) == (Known("1", "2"), None)
    journal.close()
    other = Journal(tmp_path / "r.jsonl", "two")
    assert other.known("a") is None
    other.close()


def test_the_last_of_two_runs_reports_the_rows_of_both(tmp_path):
    for path, journal in [(p, Journal(tmp_path / "r.jsonl", "work")) for p in "ab"]:
        journal.put([done(path)])
        journal.close()
    lines = (tmp_path / "r.jsonl").read_text().splitlines()
    assert [json.loads(line)["path"] for line in lines] == ["a", "b"]


@contextmanager
def full(report):
    with replacing(report):
        yield Path("/dev/full")


def test_a_file_that_is_no_journal_and_disks_that_are_full_are_told_by_name(tmp_path, monkeypatch):
    (tmp_path / ".pns-batch.journal").write_bytes(b"years of work" * 100)
    with pytest.raises(OSError, match="not a database") as refused:
        open_journal(tmp_path / "r.jsonl", "work").__enter__()
    assert refused.value.filename == f"{tmp_path}/.pns-batch.journal"
    (tmp_path / ".pns-batch.journal").unlink()

    def too_many(journal):
        journal.put([done("a")])
        journal._database.execute("PRAGMA max_page_count = 1")
        journal.put([done(f"b{number}", size="y" * 4000) for number in range(100)])

    with pytest.raises(OSError, match="is full"), open_journal(tmp_path / "r.jsonl", "w") as kept:
        too_many(kept)
    assert len((tmp_path / "r.jsonl").read_text().splitlines()) == 1
    monkeypatch.setattr("service.scale.journal.replacing", full)
    with (
        pytest.raises(OSError, match="No space left") as refused,
        open_journal(tmp_path / "r.jsonl", "work") as journal,
    ):
        journal.put([done("a")])
    assert refused.value.filename == f"{tmp_path}/r.jsonl"
